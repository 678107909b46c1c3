"""Whether results and pages are those of the committed reference: the table that ends ``make reproduce``.

Of each result file, chapter and figure the reference holds a digest, and numbers for where digests differ.
One kind of processor gives the same bytes.  Another one adds up in another order, so that a mask may differ
at a pixel and one image's estimate by a little; the tolerances say how much of that is no change.  What is
beyond them fails on the reference's kind of processor, and is told on others, where it may be rounding still.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
from pathlib import Path

import cv2
import llvmlite.binding
import numpy as np
import pandas as pd

from ..provenance import DATA, DERIVED_DATA, ROOT, load_json, page_fingerprint, profile, save_json
from ..types import InputError

RELATIVE = 0.02  # of a number; of a series, whose quartiles one of fifty images can move, its middle half too
ROUNDING = 1e-9  # what is smaller is zero, and differs everywhere
INK = 2.5  # of 255, in a cell of a figure: less than what a line adds to it
CELLS = (24, 12)  # of a figure, across and down
STATES = ("unchanged", "within tolerance", "changed")
BUILD = ROOT / "_build"
CHECKOUT_CHAPTERS = ("provenance",)  # chapters about files and versions: what they show is no result
WRAPPING = re.compile(r"(^|_)q[xyzw]$|angle_rad$")  # quaternions and angles, whose quartiles mean nothing
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")  # within words


def reference_path(of: str) -> Path:
    """Where the reference of a profile is committed."""
    return DATA / "reference" / f"{of}.json"


def inventory(results: Path, chapters: Path) -> dict[str, dict]:
    """Digest and numbers of all that one may compare.

    Parameters
    ----------
    results
        Folder of result files, ``*.csv`` and ``*.json``.
    chapters
        Folder of executed notebooks, with their glued numbers beside them.

    Returns
    -------
    dict
        By name, in order: ``{"sha256": ..., "numbers": {...}}``.
    """
    items = {}
    for path in sorted(results.glob("*.csv")):
        items[path.name] = _item(path.read_bytes(), of_table(pd.read_csv(path)))
    for path in sorted(results.glob("*.json")):
        if not path.name.endswith(".provenance.json"):
            values = json.loads(path.read_text())
            values = values.get("values", values)  # their provenance names the commit, which may be another
            items[path.name] = _item(json.dumps(values).encode(), _flat(values))
    for path in sorted(chapters.glob("*.ipynb")):
        if path.stem not in CHECKOUT_CHAPTERS:
            items |= _chapter(path)
    return items


def _item(content: bytes, numbers: dict) -> dict:
    return {"sha256": hashlib.sha256(content).hexdigest()[:16], "numbers": numbers}


def of_table(table: pd.DataFrame) -> dict:
    """Numbers of a table: each cell where words name the rows, or of a table of words only; of a series its
    length, how often it has each word, and the quartiles of its columns."""
    words = table.select_dtypes(["object", "string", "bool"])
    values = table[[c for c in table if c not in words and not WRAPPING.search(c)]]
    names = words.astype(str).agg(" ".join, axis=1) if words.size else pd.Series(dtype=str)
    if len(words.columns) == len(table.columns) > 1:
        return {f"{row[0]} {c}": str(v) for row in table.to_numpy() for c, v in zip(table, row, strict=True)}
    if len(names) and names.is_unique:
        return {f"{n} {c}": _digits(v) for c in values for n, v in zip(names, values[c], strict=True)}
    found = {"rows": len(table)}
    for column in words:
        counts = words[column].value_counts().sort_index()
        found[f"{column} {', '.join(map(str, counts.index))}"] = counts.tolist()
    for column in values:
        found[f"{column} known"] = int(values[column].notna().sum())
        found[f"{column} quartiles"] = [_digits(q) for q in values[column].quantile([0.25, 0.5, 0.75])]
    return found


def _flat(values, name: str = "") -> dict:
    """Numbers and words of nested JSON, by their path."""
    if isinstance(values, dict | list):
        parts = values.items() if isinstance(values, dict) else enumerate(values)
        return {k: v for key, part in parts for k, v in _flat(part, f"{name} {key}".strip()).items()}
    return {name: _digits(values)}


def _digits(value):
    """Six of them, as the result files have; None for NaN, which JSON does not know."""
    if isinstance(value, str | bool | None):
        return value
    return float(f"{value:.6g}") if np.isfinite(value) else None


def _chapter(path: Path) -> dict[str, dict]:
    """A chapter's glued numbers, and each of its figures."""
    glued = json.loads(path.with_suffix(".glue.json").read_text())
    said = {name: output["data"].get("text/plain", "") for name, output in sorted(glued.items())}
    numbers = {name: _spoken(text) for name, text in said.items()}
    items = {f"{path.stem}, numbers": _item(json.dumps(said).encode(), numbers)}
    cells = json.loads(path.read_text())["cells"]
    shown = [output.get("data", {}) for cell in cells for output in cell.get("outputs", [])]
    pictures = [base64.b64decode(data["image/png"]) for data in shown if "image/png" in data]
    moving = ["".join(data["text/html"]) for data in shown if "Plotly" in "".join(data.get("text/html", ""))]
    for k, png in enumerate(pictures, 1):
        items[f"{path.stem}, figure {k}"] = _item(png, {"ink": ink(png)})
    for k, html in enumerate(moving, 1):
        numbers = pd.DataFrame({"numbers": [float(n) for n in re.findall(r"-?\d+\.\d+(?:e-?\d+)?", html)]})
        items[f"{path.stem}, interactive figure {k}"] = _item(html.encode(), of_table(numbers))
    return items


def _spoken(text: str):
    try:
        return _digits(float(text))
    except ValueError:
        return text


def ink(png: bytes) -> str:
    """How dark a figure is in each of `CELLS`, on white, two hexadecimal digits a cell."""
    picture = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED).astype(np.float32)
    opacity = picture[..., 3:] / 255 if picture.ndim == 3 and picture.shape[2] == 4 else np.float32(1)
    light = (picture[..., :3] * opacity + 255 * (1 - opacity)).mean(-1)
    return (255 - cv2.resize(light, CELLS, interpolation=cv2.INTER_AREA)).astype(np.uint8).tobytes().hex()


def moved(name: str, was, now) -> float:
    """By how many tolerances a number has moved; infinite where there is another word, or none.

    Numbers within words may also differ by one in their last digit.
    """
    if name == "ink":
        was, now = (np.frombuffer(bytes.fromhex(x), np.uint8).astype(float) for x in (was, now))
        return float(np.abs(now - was).max() / INK)
    if isinstance(was, str) and isinstance(now, str) and NUMBER.sub("#", was) == NUMBER.sub("#", now):
        pairs = zip(NUMBER.findall(was), NUMBER.findall(now), strict=True)
        return max((_moved_in_words(a, b) for a, b in pairs), default=0.0)
    known = [None not in np.ravel(np.array(x, object)) and not isinstance(x, str) for x in (was, now)]
    if not all(known) or np.shape(was) != np.shape(now):
        return 0.0 if was == now else np.inf
    was, now = np.atleast_1d(was).astype(float), np.atleast_1d(now).astype(float)
    return float((np.abs(now - was) / (RELATIVE * (np.abs(was) + np.ptp(was)) + ROUNDING)).max())


def _moved_in_words(was: str, now: str) -> float:
    last_digit = 1.001 * 10.0 ** -len(was.partition(".")[2])  # and a little for its binary fraction
    return abs(float(now) - float(was)) / (RELATIVE * abs(float(was)) + last_digit)


def compare(reference: dict[str, dict], found: dict[str, dict]) -> pd.DataFrame:
    """One row per item of either inventory: ``item``, ``state`` (one of `STATES`), ``why``."""
    rows = []
    for name in [*found, *(n for n in reference if n not in found)]:
        if name not in found or name not in reference:
            rows.append((name, "changed", "is absent" if name in reference else "is not in the reference"))
        elif found[name]["sha256"] == reference[name]["sha256"]:
            rows.append((name, "unchanged", ""))
        else:
            rows.append((name, *_judged(reference[name]["numbers"], found[name]["numbers"])))
    return pd.DataFrame(rows, columns=["item", "state", "why"])


def _judged(was: dict, now: dict) -> tuple[str, str]:
    by = {n: moved(n, was[n], now[n]) if n in was and n in now else np.inf for n in [*was, *now]}
    if not by:
        return "changed", "holds no number to judge it by"
    worst = max(by, key=by.get)
    if worst == "ink":
        why = "drawn otherwise"
    else:
        why = f"{worst}: {_said(was.get(worst))} -> {_said(now.get(worst))}"
    return ("within tolerance" if by[worst] <= 1 else "changed"), why


def _said(value) -> str:
    values = value if isinstance(value, list) else [value]
    return ", ".join(f"{v:.4g}" if isinstance(v, float) else str(v) for v in values)


def processor() -> str:
    """The kind of processor for which kernels are compiled here."""
    return llvmlite.binding.get_host_cpu_name()


def check(update: bool = False, report=print) -> None:
    """Compare results and pages of the present profile with the reference, or make them the reference.

    Raises
    ------
    InputError
        If there are no pages, or pages of other sources than the present ones; if there is no reference;
        if anything has changed.
    """
    of, path = profile(), reference_path(profile())
    if not (BUILD / "execution" / page_fingerprint()).is_dir():
        raise InputError(f"{BUILD}: no pages of the present module, data and pins; run 'make book' first")
    found = inventory(DERIVED_DATA / of, BUILD / "jupyter_execute" / "book")
    if not found:
        raise InputError(f"{DERIVED_DATA / of}: no results; run 'make book' first")
    if update:
        save_json(path, {"processor": processor(), "items": found}, profile=of)
        report(f"{path}: {len(found)} items, now the reference")
        return
    try:
        reference = load_json(path)
        table = compare(reference["items"], found)
    except (OSError, ValueError, KeyError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{path}: no reference ({reason}); make one with 'lmmap check --update'") from None
    for row in table.itertuples():
        report(f"{row.item:42} {row.state:16} {row.why}".rstrip())
    counts = table.state.value_counts()
    report(f"profile {of}: " + ", ".join(f"{counts.get(state, 0)} {state}" for state in STATES))
    if "changed" in counts and processor() != reference["processor"]:
        report(f"This processor ({processor()}) is of another kind than the reference's "
               f"({reference['processor']}), so what has changed is told, not judged.")  # fmt: skip
    elif "changed" in counts:
        raise InputError(f"{path}: {counts['changed']} of {len(table)} items have changed; see why, and if "
                         "they should, make them the reference: 'lmmap check --update'")  # fmt: skip
