"""Whether results and pages are those of the committed reference: the table that ends ``make reproduce``.

The reference holds a digest of each result file, chapter and figure, and numbers for where digests differ.
The same kind of processor gives the same bytes.  Another kind adds up in another order, so that a pixel of a
mask or an image's estimate may differ a little; the tolerances say how much of that is no change.  On the
reference's kind of processor a difference beyond them is an error.  On others it is only reported, because it
may still come from rounding.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd

from lmmap.types import InputError

from ..provenance import DATA, DERIVED_DATA, ROOT, load_json, page_fingerprint, processor, profile, save_json
from .inventory import inventory

RELATIVE = 0.02  # of a number; of a series, whose quartiles one of fifty images can move, its middle half too
ROUNDING = 1e-9  # smaller differences are rounding, which is another on each processor
INK = 2.5  # of 255, in a cell of a figure: less than a line adds to it
STATES = ("unchanged", "within tolerance", "changed")
BUILD = ROOT / "_build"
NUMBER = re.compile(r"-?\d+(?:\.\d+)?")  # within words


def reference_path(profile: str) -> Path:
    """Where the reference of a profile is committed."""
    return DATA / "reference" / f"{profile}.json"


def deviation(name: str, was, now) -> float:
    """By how many tolerances two values of ``name`` differ; infinite for another word or a missing value.

    Numbers within words may also differ by one in their last digit.
    """
    if name == "ink":
        was, now = (np.frombuffer(bytes.fromhex(x), np.uint8).astype(float) for x in (was, now))
        return float(np.abs(now - was).max() / INK)
    if isinstance(was, str) and isinstance(now, str) and NUMBER.sub("#", was) == NUMBER.sub("#", now):
        pairs = zip(NUMBER.findall(was), NUMBER.findall(now), strict=True)
        return max((_deviation_in_words(a, b) for a, b in pairs), default=0.0)
    known = [None not in np.ravel(np.array(x, object)) and not isinstance(x, str) for x in (was, now)]
    if not all(known) or np.shape(was) != np.shape(now):
        return 0.0 if was == now else np.inf
    was, now = np.atleast_1d(was).astype(float), np.atleast_1d(now).astype(float)
    return float((np.abs(now - was) / (RELATIVE * (np.abs(was) + np.ptp(was)) + ROUNDING)).max())


def _deviation_in_words(was: str, now: str) -> float:
    last_digit = 1.001 * 10.0 ** -len(was.partition(".")[2])  # and a little for its binary fraction
    return abs(float(now) - float(was)) / (RELATIVE * abs(float(was)) + last_digit)


def compare(reference: dict[str, dict], present: dict[str, dict]) -> pd.DataFrame:
    """One row per item of either `inventory`: ``item``, ``state`` (one of `STATES`), ``why``."""
    rows = []
    for name in [*present, *(n for n in reference if n not in present)]:
        if name not in present or name not in reference:
            rows.append((name, "changed", "is absent" if name in reference else "is not in the reference"))
        elif present[name]["sha256"] == reference[name]["sha256"]:
            rows.append((name, "unchanged", ""))
        else:
            rows.append((name, *_judge(reference[name]["numbers"], present[name]["numbers"])))
    return pd.DataFrame(rows, columns=["item", "state", "why"])


def _judge(was: dict, now: dict) -> tuple[str, str]:
    """State of an item whose digest differs, and why, from its numbers."""
    by = {n: deviation(n, was[n], now[n]) if n in was and n in now else np.inf for n in [*was, *now]}
    if not by:
        return "changed", "holds no number to judge it by"
    worst = max(by, key=by.get)
    if worst == "ink":
        why = "drawn otherwise"
    else:
        why = f"{worst}: {_short(was.get(worst))} -> {_short(now.get(worst))}"
    return ("within tolerance" if by[worst] <= 1 else "changed"), why


def _short(value) -> str:
    values = value if isinstance(value, list) else [value]
    return ", ".join(f"{v:.4g}" if isinstance(v, float) else str(v) for v in values)


def check(update: bool = False, report=print, *, results: Path | None = None, path: Path | None = None,
          build: Path = BUILD, on: str | None = None) -> None:  # fmt: skip
    """Compare results and pages with the reference, or make them the reference.

    Parameters
    ----------
    results, path
        The folder of results and the file of the reference; default: those of the present profile.
    build
        The folder of the built pages.
    on
        The kind of processor that made them; default: `processor`.

    Raises
    ------
    InputError
        If there are no pages, or pages of other sources than the present ones; if there is no reference;
        if anything has changed.
    """
    path, results = path or reference_path(profile()), results or DERIVED_DATA / profile()
    on = on or processor()
    if not (build / "execution" / page_fingerprint()).is_dir():
        raise InputError(f"{build}: no pages of the present module, data and pins; run 'make book' first")
    present = inventory(results, build / "jupyter_execute" / "book")
    if not present:
        raise InputError(f"{results}: no results; run 'make book' first")
    if update:
        save_json(path, {"processor": on, "items": present}, profile=profile())
        report(f"{path}: {len(present)} items, now the reference")
        return
    try:
        reference = load_json(path)
        table = compare(reference["items"], present)
    except (OSError, ValueError, KeyError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{path}: no reference ({reason}); make one with 'lmmap check --update'") from None
    for row in table.itertuples():
        report(f"{row.item:42} {row.state:16} {row.why}".rstrip())
    counts = table.state.value_counts()
    report(f"profile {profile()}: " + ", ".join(f"{counts.get(state, 0)} {state}" for state in STATES))
    if "changed" in counts and on != reference["processor"]:
        report(f"This processor ({on}) is of another kind than the reference's "
               f"({reference['processor']}), so what has changed is told, not judged.")  # fmt: skip
    elif "changed" in counts:
        raise InputError(f"{path}: {counts['changed']} of {len(table)} items have changed; see why, and if "
                         "they should, make them the reference: 'lmmap check --update'")  # fmt: skip
