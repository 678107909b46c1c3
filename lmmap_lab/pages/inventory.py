"""What can be compared with the reference: digests and numbers of results, glued numbers and figures.

Where digests differ, numbers tell rounding from a change.  A figure's numbers are its darkness in a grid of
cells: on another kind of processor than the reference's, most figures have other bytes.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

CELLS = (24, 12)  # of a figure, across and down
CHECKOUT_CHAPTERS = ("provenance",)  # chapters about files and versions: what they show is no result
WRAPPING = re.compile(r"(^|_)q[xyzw]$|angle_rad$")  # quaternions and angles, whose quartiles mean nothing


def inventory(results: Path, chapters: Path) -> dict[str, dict]:
    """Digest and numbers of all results, glued numbers and figures.

    Parameters
    ----------
    results
        Folder of result files, ``*.csv`` and ``*.json``.
    chapters
        Folder of executed notebooks, with their glued numbers beside them.

    Returns
    -------
    dict
        ``{"sha256": ..., "numbers": {...}}`` by the item's name, in a fixed order.
    """
    items = {}
    for path in sorted(results.glob("*.csv")):
        items[path.name] = _item(path.read_bytes(), table_numbers(pd.read_csv(path)))
    for path in sorted(results.glob("*.json")):
        if not path.name.endswith(".provenance.json"):
            values = json.loads(path.read_text())
            values = values.get("values", values)  # without their provenance, which names the commit
            items[path.name] = _item(json.dumps(values).encode(), _json_numbers(values))
    for path in sorted(chapters.glob("*.ipynb")):
        if path.stem not in CHECKOUT_CHAPTERS:
            items |= _chapter_items(path)
    return items


def _item(content: bytes, numbers: dict) -> dict:
    return {"sha256": hashlib.sha256(content).hexdigest()[:16], "numbers": numbers}


def table_numbers(table: pd.DataFrame) -> dict:
    """Numbers of a table by name.

    A table whose rows are named by words, or that has only words, gives each cell.  A series gives its
    length, how often it has each word, and the quartiles of its columns.
    """
    words = table.select_dtypes(["object", "string", "bool"])
    values = table[[c for c in table if c not in words and not WRAPPING.search(c)]]
    names = words.astype(str).agg(" ".join, axis=1) if words.size else pd.Series(dtype=str)
    if len(words.columns) == len(table.columns) > 1:
        return {f"{row[0]} {c}": str(v) for row in table.to_numpy() for c, v in zip(table, row, strict=True)}
    if len(names) and names.is_unique:
        return {f"{n} {c}": _digits(v) for c in values for n, v in zip(names, values[c], strict=True)}
    numbers = {"rows": len(table)}
    for column in words:
        counts = words[column].value_counts().sort_index()
        numbers[f"{column} {', '.join(map(str, counts.index))}"] = counts.tolist()
    for column in values:
        numbers[f"{column} known"] = int(values[column].notna().sum())
        numbers[f"{column} quartiles"] = [_digits(q) for q in values[column].quantile([0.25, 0.5, 0.75])]
    return numbers


def _json_numbers(values, name: str = "") -> dict:
    """Numbers and words of nested JSON by their path."""
    if isinstance(values, dict | list):
        parts = values.items() if isinstance(values, dict) else enumerate(values)
        return {k: v for key, part in parts for k, v in _json_numbers(part, f"{name} {key}".strip()).items()}
    return {name: _digits(values)}


def _digits(value):
    """A number in six digits, as result files have it; None for NaN, which JSON does not know."""
    if isinstance(value, str | bool | None):
        return value
    return float(f"{value:.6g}") if np.isfinite(value) else None


def _chapter_items(path: Path) -> dict[str, dict]:
    """Items of a chapter: its glued numbers together, and each of its figures."""
    file = path.with_suffix(".glue.json")  # which a chapter that glues nothing has not
    glued = json.loads(file.read_text()) if file.exists() else {}
    texts = {name: output["data"].get("text/plain", "") for name, output in sorted(glued.items())}
    numbers = {name: _number_or_text(text) for name, text in texts.items()}
    items = {f"{path.stem}, numbers": _item(json.dumps(texts).encode(), numbers)} if numbers else {}
    cells = json.loads(path.read_text())["cells"]
    outputs = [output.get("data", {}) for cell in cells for output in cell.get("outputs", [])]
    pictures = [base64.b64decode(data["image/png"]) for data in outputs if "image/png" in data]
    pages = ["".join(data.get("text/html", "")) for data in outputs]
    for k, png in enumerate(pictures, 1):
        items[f"{path.stem}, figure {k}"] = _item(png, {"ink": ink(png)})
    for k, html in enumerate((page for page in pages if 'class="steps"' in page), 1):
        numbers = pd.DataFrame({"numbers": [float(n) for n in re.findall(r"-?\d+\.\d+(?:e-?\d+)?", html)]})
        items[f"{path.stem}, interactive figure {k}"] = _item(html.encode(), table_numbers(numbers))
    return items


def _number_or_text(text: str):
    try:
        return _digits(float(text))
    except ValueError:
        return text


def ink(png: bytes) -> str:
    """Darkness of a figure on white in each of `CELLS`, two hexadecimal digits a cell."""
    picture = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED).astype(np.float32)
    opacity = picture[..., 3:] / 255 if picture.ndim == 3 and picture.shape[2] == 4 else np.float32(1)
    light = (picture[..., :3] * opacity + 255 * (1 - opacity)).mean(-1)
    return (255 - cv2.resize(light, CELLS, interpolation=cv2.INTER_AREA)).astype(np.uint8).tobytes().hex()
