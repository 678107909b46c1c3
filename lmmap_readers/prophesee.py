"""Recordings of Prophesee's cameras: RAW files of EVT2, EVT2.1 or EVT3, DAT, and their layout of HDF5."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import h5py
import numpy as np

from lmmap.files import regular_file
from lmmap.recordings.hdf5_datasets import blocks, open_dataset
from lmmap.recordings.stream import CHUNK, Source, in_chunks, reader
from lmmap.types import event_array

from .evt import Evt2, Evt3, Evt21, HighTime
from .units import microseconds

PIECE = 1 << 18  # bytes decoded at once
MAX_HEADER = 1 << 16  # bytes; real headers have a few hundred
DECODERS = {"EVT2": Evt2, "EVT21": Evt21, "EVT3": Evt3}
HDF5_EVENTS = "CD/events"
DAT_TYPES = (0x00, 0x0C)  # generic events, contrast detection
prophesee_file = reader("not a recording of Prophesee's", "copy it again, or export it as RAW, DAT or HDF5")


@prophesee_file
def read_raw(path: Path) -> Source:
    """Read the events of a RAW file, in the camera's own time; raises `InputError`.

    The sensor's size is the header's, if it states one (before 2022, not all do).
    """
    fields, start = _header(path)
    details = partial(dict, encoding=_decoder(fields).encoding)
    events = partial(_raw, path, fields, start)
    return Source(path, _size_px(fields), events, details=details)


@prophesee_file
def read_dat(path: Path) -> Source:
    """Read the events of a DAT file, version 2; raises `InputError`."""
    fields, start = _header(path)
    if fields.get("version", "2") != "2":
        raise ValueError(f"DAT of version {fields['version']}, expected 2")
    with path.open("rb") as file:
        file.seek(start)
        kind, size = file.read(2).ljust(2, b"\0")
    if kind not in DAT_TYPES or size != 8:
        raise ValueError(f"events of type {kind} and {size} bytes, expected contrast events of 8 bytes")
    return Source(path, _size_px(fields), partial(_dat, path, start + 2))


def _raw(path: Path, fields: dict[str, str], start: int):
    decoder = _decoder(fields)
    return in_chunks(decoder.events(words) for words in _words(path, start, decoder.word))


def _dat(path: Path, start: int):
    record, time = np.dtype([("t", "<u4"), ("xyp", "<u4")]), HighTime(32)

    def events(e: np.ndarray) -> np.ndarray:
        xyp = e["xyp"]
        return event_array(time.unroll(e["t"]), xyp & 0x3FFF, xyp >> 14 & 0x3FFF, xyp >> 28)

    return in_chunks(events(e) for e in _words(path, start, record))


def _words(path: Path, start: int, word: np.dtype):
    """Words of a file in runs; ValueError, after all that are whole, where it ends inside one."""
    with path.open("rb") as file:
        file.seek(start)
        while piece := file.read(PIECE):
            whole = len(piece) // word.itemsize
            yield np.frombuffer(piece, word, whole)
            if rest := len(piece) - whole * word.itemsize:
                raise ValueError(f"it ends {rest} bytes into a word of {word.itemsize}")


def _header(path: Path) -> tuple[dict[str, str], int]:
    """Keywords of the lines that begin with "% ", in lower case, and where the data begin."""
    with regular_file(path).open("rb") as file:
        head = file.read(MAX_HEADER)
    fields, at = {}, 0
    while head[at : at + 2] == b"% " and (end := head.find(b"\n", at)) >= 0:
        key, _, value = head[at + 2 : end].decode("latin-1").strip().partition(" ")
        at = end + 1
        if key.lower() == "end":
            break
        fields[key.lower()] = value.strip()
    if not fields:
        raise ValueError("no header of lines that begin with '% '")
    return fields, at


def _decoder(fields: dict[str, str]) -> Evt2 | Evt21 | Evt3:
    name, _, more = fields.get("format", "").partition(";")
    if not name:
        name = "EVT" + fields.get("evt", "?").removesuffix(".0").replace(".", "")
    if name not in DECODERS:
        raise ValueError(f"events encoded as {name}, expected one of {', '.join(DECODERS)}")
    options = _options(more)
    if options.get("endianness") == "big":
        raise ValueError("words in big-endian order")
    return Evt21(options.get("endianness") == "legacy") if name == "EVT21" else DECODERS[name]()


def _options(text: str) -> dict[str, str]:
    return dict(part.split("=", 1) for part in text.split(";") if "=" in part)


def _size_px(fields: dict[str, str]) -> tuple[int, int] | None:
    """Width and height, from any of the ways in which headers say them."""
    options = _options(fields.get("format", ""))
    stated = "x".join(options.get(n) or fields.get(n) or "" for n in ("width", "height"))
    size = re.fullmatch(r"([0-9]{1,5})x([0-9]{1,5})", fields.get("geometry", stated))
    return (int(size[1]), int(size[2])) if size else None


def hdf5_events(file: h5py.File, time_unit: str | None) -> Iterator[np.ndarray]:
    """Yield arrays of events (M,) EVENT from the data set ``CD/events``; ValueError if it cannot be read."""
    for (e,) in blocks(CHUNK, _rows(file)):
        yield event_array(microseconds(e["t"], time_unit), *(e[name] for name in "xyp"))


def hdf5_span_us(file: h5py.File, time_unit: str | None) -> tuple[int, int] | None:
    """Times (us) of the first and the last event; None without events."""
    rows = _rows(file)
    ends = microseconds(np.array([rows[k]["t"] for k in (0, len(rows) - 1)]), time_unit) if len(rows) else ()
    return tuple(map(int, ends)) or None


def hdf5_size_px(file: h5py.File) -> tuple[int, int] | None:
    """Width and height from the attribute ``geometry``."""
    return _size_px({"geometry": str(file.attrs.get("geometry", ""))})


def _rows(file: h5py.File) -> h5py.Dataset:
    return open_dataset(file, HDF5_EVENTS, 1, columns="txyp")


read_raw.what = "Prophesee RAW: EVT2, EVT2.1, EVT3"
read_dat.what = "Prophesee DAT"
