"""Events as text, a line ``t x y p`` an event, as in the data sets of the University of Zurich (RPG)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd

from ..pipeline.histograms import from_columns
from .stream import CHUNK, Source, input_errors


def read(path: Path) -> Source:
    """Events of lines ``t x y p``: seconds where ``t`` has a decimal point, else microseconds."""
    next(events(path), None)  # a file that is no text is refused now, not when it is used
    return Source(path, events=lambda: events(path))


def events(path: Path) -> Iterator[np.ndarray]:
    """Chunks (M,) EVENT of a text file; raises `InputError`."""
    remedy = "expected lines 't x y p' with t in seconds, or in whole microseconds"
    with input_errors(path, "not events as text", remedy), path.open("rb") as file:
        tables = pd.read_csv(file, sep=r"\s+", header=None, comment="#", index_col=False, chunksize=CHUNK,
                             names=["t", "x", "y", "p", "more"])  # fmt: skip
        time_kind = None
        for table in tables:
            if table["more"].notna().any() or any(table[name].dtype.kind not in "if" for name in "txyp"):
                raise ValueError("a line does not hold four numbers")
            kind = table["t"].dtype.kind
            if time_kind not in (None, kind):
                raise ValueError("times with and without a decimal point")
            time_kind = kind
            yield from_columns(*(table[name].to_numpy() for name in "txyp"), seconds=kind == "f")
