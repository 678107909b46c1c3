"""Events as rows: lines ``t x y p`` of text, as in the data sets of the University of Zurich (RPG), a CSV
with a header, or a structured array in ``.npy``.

Columns are found by the names that people use.  The unit of time is what its name states, as in ``t_us``,
``timestamp (ns)`` or ``time [s]``; without one, whole numbers are microseconds and others seconds.  Lines of
text without names may have the columns in another order, and begin with the sensor's size, as E2VID's do.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from itertools import islice, permutations
from pathlib import Path
from tokenize import TokenError
from typing import BinaryIO

import numpy as np
import pandas as pd
from numpy.lib import format as npy_format

from lmmap.files import regular_file
from lmmap.recordings.stream import CHUNK, Source, pieces, reader
from lmmap.types import event_array

from .units import Guessed, microseconds

MAX_LINE_BYTES = 2**20  # of text; an event takes 30 and pandas holds a whole line
SPELLINGS = {
    "t": r"(?:t|ts|time|timestamp|timestamps)(?:[ _]*[\[( _](?P<unit>s|sec|seconds|ms|us|µs|μs|ns)[\])]?)?",
    "x": r"(?:x|col|column|u)(?:@(?P<size>\d+))?",
    "y": r"(?:y|row|v)(?:@(?P<size>\d+))?",
    "p": r"(?:p|pol|polarity|on)",
}
MORE = "fields beyond the header"
ORDER_LINES = 200  # by which the order of columns is known
SIZE, NUMBER = re.compile(rb"\s*(\d{1,5})\s+(\d{1,5})\s*"), re.compile(rb"[-+.\deE]+")
ORDERS = [order for order in map("".join, permutations("txyp")) if order.index("x") < order.index("y")]
table_of_events = reader(
    "not a table of events",
    "expected columns named t, x, y and p, with t in us or with its unit, such as t_ns",
    (SyntaxError, TokenError),  # of numpy's header
)


@reader("not events as text", "expected lines 't x y p' with t in seconds, or in whole microseconds")
def read_text(path: Path, time_unit: str | None = None) -> Source:
    """Read events from lines ``t x y p``: in seconds if ``t`` has a decimal point, else in microseconds;
    raises `InputError`."""
    return _read_lines(path, _text_header, time_unit)


@table_of_events
def read_csv(path: Path, time_unit: str | None = None) -> Source:
    """Read events from a CSV with a header; raises `InputError`.  ``x@1280,y@720`` state the size (px)."""
    return _read_lines(path, _header, time_unit)


@table_of_events
def read_npy(path: Path, time_unit: str | None = None) -> Source:
    """Read events from a structured array; raises `InputError`.  Nothing in the file is executed."""
    rows, _ = _npy(path)
    columns, unit, size_px = _columns(rows.dtype.names)
    unit = time_unit or unit
    events = partial(_npy_events, path, columns, unit)
    t = rows[columns["t"]]
    return Source(path, size_px, events, guessed=None if unit else Guessed.of(t[:CHUNK]))


def _header(file: BinaryIO) -> tuple[list[str], str, None]:
    """Names in the first line that is neither empty nor a comment, what stands between them, and no size; the
    file is left behind it."""
    line = b"#"
    while line.startswith(b"#") or line.isspace():
        line = file.readline(MAX_LINE_BYTES)
    return [name.strip().strip('"') for name in line.decode().split(",")], ",", None


def _text_header(file: BinaryIO) -> tuple[list[str], str, tuple[int, int] | None]:
    """Order of the columns, what stands between them, and the sensor's size where a first line is one; the
    file is left behind that.  Another order than t x y p is taken where no other one fits, with a warning."""
    start, size_px, rows = 0, None, []
    for line in islice(iter(partial(file.readline, MAX_LINE_BYTES), b""), ORDER_LINES):
        if not rows and (match := SIZE.fullmatch(line)):
            start, size_px = file.tell(), (int(match[1]), int(match[2]))
        elif (
            (words := line.partition(b"#")[0].split())
            and len(words) == 4
            and all(map(NUMBER.fullmatch, words))
        ):
            rows.append(words)
    file.seek(start)
    order = _order(np.array(rows, float)) if rows else "txyp"
    if order != "txyp":
        warnings.warn(f"{file.name}: taking its columns as {' '.join(order)}", stacklevel=5)
    return list(order), r"\s+", size_px


def _order(rows: np.ndarray) -> str:
    """The only order of columns in which lines (N, 4) are events, or t x y p."""
    is_p = np.all(np.isin(rows, (-1, 0, 1)), 0)
    grows = np.all(np.diff(rows, axis=0) >= 0, 0)
    if is_p[3] and grows[0]:
        return "txyp"
    broken = np.any(rows % 1, 0)  # into parts of a second
    largest = rows.max(0) > np.partition(rows.max(0), -2)[-2]
    is_t = grows & (np.ptp(rows, 0) > 0) & (broken if broken.any() else largest)
    fitting = [order for order in ORDERS if is_p[order.index("p")] and is_t[order.index("t")]]
    return fitting[0] if len(fitting) == 1 else "txyp"


def _read_lines(path: Path, header: Callable[[BinaryIO], tuple], time_unit: str | None) -> Source:
    """Events of the lines behind what ``header`` reads."""
    with regular_file(path).open("rb") as file:
        (names, separator, size_px), start = header(file), file.tell()
    columns, unit, named_px = _columns(names)
    unit, times = time_unit or unit, []
    events = partial(_line_events, path, start, names, columns, unit, separator)
    next(events(times), None)  # a file that holds no such lines is refused now, not when it is used
    guessed = None if unit else Guessed.of(*times)
    return Source(path, named_px or size_px, events, guessed=guessed)


def _line_events(
    path: Path, start: int, names, columns, unit, separator: str, times: list | None = None
) -> Iterator[np.ndarray]:
    """Events of lines; ``times`` takes the first ones as they stand there."""
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
            if times is not None:
                times.append(values["t"])
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
    return event_array(microseconds(values["t"], unit), values["x"], values["y"], values["p"])


read_text.what = "events as text, t x y p"
read_csv.what = "events as a table with named columns"
read_npy.what = "events as a structured array of numpy"
