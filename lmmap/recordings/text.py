"""Events as text, a line ``t x y p`` an event, as in the data sets of the University of Zurich (RPG)."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd

from ..files import regular_file
from ..types import event_array
from .limits import MAX_LINE_BYTES
from .stream import CHUNK, Source, input_errors


def read(path: Path) -> Source:
    """Events of lines ``t x y p``: seconds where ``t`` has a decimal point, else microseconds."""
    next(events(path), None)  # a file that is no text is refused now, not when it is used
    return Source(path, events=lambda: events(path))


def events(path: Path) -> Iterator[np.ndarray]:
    """Chunks (M,) EVENT of a text file; raises `InputError`."""
    remedy = "expected lines 't x y p' with t in seconds, or in whole microseconds"
    with input_errors(path, "not events as text", remedy), regular_file(path).open("rb") as file:
        columns = ["t", "x", "y", "p", "more"]
        tables = pd.read_csv(ShortLines(file), sep=r"\s+", header=None, comment="#", index_col=False,
                             chunksize=CHUNK, names=columns)  # fmt: skip
        time_kind = None
        for table in tables:
            if table["more"].notna().any() or any(table[name].dtype.kind not in "if" for name in "txyp"):
                raise ValueError("a line does not hold four numbers")
            kind = table["t"].dtype.kind
            if time_kind not in (None, kind):
                raise ValueError("times with and without a decimal point")
            time_kind = kind
            yield event_array(*(table[name].to_numpy() for name in "txyp"), seconds=kind == "f")


class ShortLines:
    """A file whose blocks are checked for line ends: pandas would hold a line of gigabytes in memory."""

    def __init__(self, file):
        self._file, self._since_line_end = file, 0

    def read(self, size: int = -1) -> bytes:
        block = self._file.read(size if 0 <= size <= MAX_LINE_BYTES else MAX_LINE_BYTES)
        first, last = block.find(b"\n"), block.rfind(b"\n")
        if self._since_line_end + (first if first >= 0 else len(block)) > MAX_LINE_BYTES:
            raise ValueError(f"a line of more than {MAX_LINE_BYTES} bytes")
        self._since_line_end = len(block) - last if last >= 0 else self._since_line_end + len(block)
        return block

    def __iter__(self):
        raise NotImplementedError("pandas reads blocks")
