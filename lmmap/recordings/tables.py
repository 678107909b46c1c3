"""Events as a table with named columns: a CSV with a header, or a structured array in ``.npy``.

Columns are found by the names that people use.  The unit of time is what its name states, as in ``t_us``,
``timestamp (ns)`` or ``time [s]``; without one, whole numbers are microseconds and others seconds, as they
are in text.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
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
from .stream import CHUNK, Source, input_errors, pieces
from .text import ShortLines

SPELLINGS = {
    "t": r"(?:t|ts|time|timestamp|timestamps)(?:[ _]*[\[( _](?P<unit>s|sec|seconds|ms|us|µs|μs|ns)[\])]?)?",
    "x": r"(?:x|col|column|u)(?:@(?P<size>\d+))?",
    "y": r"(?:y|row|v)(?:@(?P<size>\d+))?",
    "p": r"(?:p|pol|polarity|on)",
}
MORE = "fields beyond the header"
NANOSECONDS = {"s": 10**9, "sec": 10**9, "seconds": 10**9, "ms": 10**6, "us": 1000, "ns": 1,
               "µs": 1000, "μs": 1000}  # fmt: skip


def read_csv(path: Path) -> Source:
    """Events of a CSV with a header; raises `InputError`.  ``x@1280,y@720`` state the sensor's size."""
    with _table_errors(path), regular_file(path).open("rb") as file:
        columns, unit, size_px = _columns(_header(file))
    events = partial(_csv, path, columns, unit)
    next(events(), None)  # a file that is no table is refused now, not when it is used
    return Source(path, size_px, events)


def read_npy(path: Path) -> Source:
    """Events of a structured array; raises `InputError`.  Nothing in the file is executed."""
    with _table_errors(path):
        rows, _ = _npy(path)
        columns, unit, size_px = _columns(rows.dtype.names)
    return Source(path, size_px, partial(_npy_events, path, columns, unit))


def _header(file: BinaryIO) -> list[str]:
    """Names in the first line that is neither empty nor a comment; the file is left behind it."""
    line = b"#"
    while line.startswith(b"#") or line.isspace():
        line = file.readline(MAX_LINE_BYTES)
    return [name.strip().strip('"') for name in line.decode().split(",")]


def _csv(path: Path, columns: dict[str, str], unit: str | None) -> Iterator[np.ndarray]:
    with _table_errors(path), path.open("rb") as file:
        names = _header(file)
        tables = pd.read_csv(ShortLines(file), header=None, names=[*names, MORE], comment="#",
                             index_col=False, chunksize=CHUNK)  # fmt: skip
        time_kind = None
        for table in tables:
            values = {key: table[name].to_numpy() for key, name in columns.items()}
            if table[MORE].notna().any() or any(v.dtype.kind not in "biuf" for v in values.values()):
                raise ValueError(f"a line does not hold {len(names)} numbers")
            kind = values["t"].dtype.kind
            if unit is None and time_kind not in (None, kind):
                raise ValueError("times with and without a decimal point")
            time_kind = kind
            yield _events(values, unit)


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
    with _table_errors(path):
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


def _table_errors(path: Path):
    remedy = "expected columns named t, x, y and p, with t in us or with its unit, such as t_ns"
    return input_errors(path, "not a table of events", remedy, (SyntaxError, TokenError))  # of numpy's header
