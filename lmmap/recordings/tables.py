"""Events as rows: lines ``t x y p`` of text, as in the data sets of the University of Zurich (RPG), a CSV
with a header, or a structured array in ``.npy``.

Columns are found by the names that people use.  The unit of time is what its name states, as in ``t_us``,
``timestamp (ns)`` or ``time [s]``; without one, whole numbers are microseconds and others seconds.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from tokenize import TokenError
from typing import BinaryIO

import numpy as np
import pandas as pd
from numpy.lib import format as npy_format

from ..files import regular_file
from ..types import event_array
from .limits import MAX_LINE_BYTES
from .stream import CHUNK, Source, pieces, reader

SPELLINGS = {
    "t": r"(?:t|ts|time|timestamp|timestamps)(?:[ _]*[\[( _](?P<unit>s|sec|seconds|ms|us|µs|μs|ns)[\])]?)?",
    "x": r"(?:x|col|column|u)(?:@(?P<size>\d+))?",
    "y": r"(?:y|row|v)(?:@(?P<size>\d+))?",
    "p": r"(?:p|pol|polarity|on)",
}
MORE = "fields beyond the header"
NANOSECONDS = {"s": 10**9, "sec": 10**9, "seconds": 10**9, "ms": 10**6, "us": 1000, "ns": 1,
               "µs": 1000, "μs": 1000}  # fmt: skip
table_of_events = reader(
    "not a table of events",
    "expected columns named t, x, y and p, with t in us or with its unit, such as t_ns",
    (SyntaxError, TokenError),  # of numpy's header
)


@reader("not events as text", "expected lines 't x y p' with t in seconds, or in whole microseconds")
def read_text(path: Path) -> Source:
    """Events of lines ``t x y p``: seconds where ``t`` has a decimal point, else microseconds."""
    return _read_lines(path, lambda _: list("txyp"), r"\s+")


@table_of_events
def read_csv(path: Path) -> Source:
    """Events of a CSV with a header; raises `InputError`.  ``x@1280,y@720`` state the sensor's size."""
    return _read_lines(path, _header, ",")


@table_of_events
def read_npy(path: Path) -> Source:
    """Events of a structured array; raises `InputError`.  Nothing in the file is executed."""
    rows, _ = _npy(path)
    columns, unit, size_px = _columns(rows.dtype.names)
    return Source(path, size_px, partial(_npy_events, path, columns, unit))


def _header(file: BinaryIO) -> list[str]:
    """Names in the first line that is neither empty nor a comment; the file is left behind it."""
    line = b"#"
    while line.startswith(b"#") or line.isspace():
        line = file.readline(MAX_LINE_BYTES)
    return [name.strip().strip('"') for name in line.decode().split(",")]


def _read_lines(path: Path, names_of: Callable[[BinaryIO], list[str]], separator: str) -> Source:
    """Events of the lines behind what ``names_of`` reads."""
    with regular_file(path).open("rb") as file:
        names, start = names_of(file), file.tell()
    columns, unit, size_px = _columns(names)
    events = partial(_line_events, path, start, names, columns, unit, separator)
    next(events(), None)  # a file that holds no such lines is refused now, not when it is used
    return Source(path, size_px, events)


def _line_events(path: Path, start: int, names, columns, unit, separator: str) -> Iterator[np.ndarray]:
    with path.open("rb") as file:
        file.seek(start)
        tables = pd.read_csv(ShortLines(file), sep=separator, header=None, names=[*names, MORE], comment="#",
                             index_col=False, chunksize=CHUNK)  # fmt: skip
        time_kind = None
        for table in tables:
            values = {key: table[name].to_numpy() for key, name in columns.items()}
            kinds = {key: value.dtype.kind for key, value in values.items()}
            words = [key for key, kind in kinds.items() if kind not in ("biuf" if key == "p" else "iuf")]
            if words or table[MORE].notna().any():
                raise ValueError(f"a line does not hold {len(names)} numbers")
            if unit is None and time_kind not in (None, kinds["t"]):
                raise ValueError("times with and without a decimal point")
            time_kind = kinds["t"]
            yield _events(values, unit)


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


def _npy(path: Path) -> tuple[np.ndarray, int]:
    """The whole rows that an array's file holds, and how many rows its header states."""
    with regular_file(path).open("rb") as file:
        version = npy_format.read_magic(file)
        of_version = {(1, 0): npy_format.read_array_header_1_0}
        shape, _, kind = of_version.get(version, npy_format.read_array_header_2_0)(file)
        start = file.tell()
    if len(shape) != 1 or shape[0] < 0 or kind.names is None or kind.hasobject or not kind.itemsize:
        raise ValueError("not a structured array of numbers in one dimension")
    if version == (3, 0):
        kind.names = [name.encode("latin1").decode() for name in kind.names]  # numpy reads it as version 2
    whole = min((path.stat().st_size - start) // kind.itemsize, *shape)
    rows = np.memmap(path, kind, "r", start, (whole,)) if whole else np.zeros(0, kind)
    return rows, *shape


def _npy_events(path: Path, columns: dict[str, str], unit: str | None) -> Iterator[np.ndarray]:
    rows, stated = _npy(path)
    for piece in pieces(rows, CHUNK):
        yield _events({key: np.array(piece[name]) for key, name in columns.items()}, unit)
    if len(rows) < stated:
        raise ValueError(f"it ends after {len(rows)} of {stated} rows")


def _columns(names) -> tuple[dict[str, str], str | None, tuple[int, int] | None]:
    """Which column is t, x, y and p; the unit of t and the sensor's size where the names state them."""
    columns, stated = {}, {}
    for key, spelling in SPELLINGS.items():
        matches = [(n, m) for n in names if (m := re.fullmatch(spelling, str(n).strip().lower()))]
        if len(matches) != 1:
            problem = "no column" if not matches else "more than one column"
            raise ValueError(f"{problem} for {key} among {', '.join(map(str, names)) or 'none'}")
        columns[key], stated[key] = matches[0][0], matches[0][1].groupdict()
    width, height = stated["x"]["size"], stated["y"]["size"]
    return columns, stated["t"]["unit"], (int(width), int(height)) if width and height else None


def _events(values: dict[str, np.ndarray], unit: str | None) -> np.ndarray:
    t = values["t"]
    if t.dtype.kind not in "iuf":
        raise ValueError(f"times of type {t.dtype}")
    seconds = t.dtype.kind == "f" and unit in (None, "s", "sec", "seconds")
    if not seconds and unit is not None:
        t = _microseconds(t, NANOSECONDS[unit])
    return event_array(t, values["x"], values["y"], values["p"], seconds=seconds)


def _microseconds(t: np.ndarray, unit_ns: int) -> np.ndarray:
    """Times in microseconds, of whole numbers exactly, rounded where they have more digits."""
    if t.dtype.kind == "f":
        return np.rint(t * (unit_ns / 1000))
    if len(t) and max(-int(t.min()), int(t.max())) > 2**62 // max(unit_ns // 1000, 1):
        raise ValueError("a time does not fit 64 bit of microseconds")
    t = t.astype(np.int64)
    return t * (unit_ns // 1000) if unit_ns >= 1000 else (t + 500) // 1000
