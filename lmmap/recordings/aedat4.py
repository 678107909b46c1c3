"""AEDAT4, iniVation's format.

Read here byte by byte: iniVation's dv-processing trusts what is in a file, and of
2000 damaged files 7 crashed or hung it.  Layout: magic, size-prefixed flatbuffer IOHeader, packets (int32
stream, int32 size, compressed size-prefixed flatbuffer), table of packets.
"""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Iterable, Iterator
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import lz4.frame
import numpy as np
from backports import zstd

from ..types import EVENT, InputError
from .flatbuffers import Table, unpack
from .limits import MAX_CHUNK_BYTES, MAX_RECORD_BYTES, check_image
from .stream import Source, in_chunks, nothing, reader

MAGIC = b"#!AER-DAT4.0\r\n"
FIRST_FRAMES = 100  # whose exposure is looked at
CHANNELS = {0: 1, 16: 3, 24: 4}  # of a frame, by its format: gray, BGR, BGRA
DECOMPRESSORS = {1: lz4.frame.LZ4FrameDecompressor, 2: lz4.frame.LZ4FrameDecompressor,
                 3: zstd.ZstdDecompressor, 4: zstd.ZstdDecompressor}  # fmt: skip
DAMAGE = zstd.ZstdError, RuntimeError, ElementTree.ParseError


@reader("damaged AEDAT4", "record or copy the file again", DAMAGE)
def read(path: Path, stream: int | str | None = None) -> Source:
    """Read a file's events and frames; raises `InputError`.  They are those of one camera: the first, or the
    one of ``stream``; a warning names what is left out.

    Values are as stored: neither the order of time nor the range of coordinates is checked here.
    """
    compression, end, streams = _header(path)
    if end >= 0 and not _whole_table(path, end, compression):
        raise ValueError("truncated in its table of packets")
    if end < 0:
        text = "its recording was cut off; reading only its complete packets"
        warnings.warn(f"{path}: {text}", stacklevel=7)
    used = _chosen(path, streams, stream)
    sizes = {streams[k].size_px for k in used.values()}
    if len(sizes) != 1:
        raise ValueError(f"expected events or frames of one size, found {sorted(sizes)}")
    number: dict[str, Any] = {kind: used.get(kind) for kind in ("EVTS", "FRME")}
    span_us, places = None, list(_packets(path, end, streams, number["EVTS"]))
    if places:
        ends = [_events_of(content) for content in _contents(path, compression, (places[0], places[-1]))]
        span_us = (int(ends[0]["t_us"][0]), int(ends[1]["t_us"][-1])) if all(map(len, ends)) else None
    events = partial(_events, path, used["EVTS"]) if "EVTS" in used else nothing
    frames = partial(_frames, path, used["FRME"]) if "FRME" in used else nothing
    details = partial(_details, path, sorted({s.kind for s in streams.values()}), number["FRME"])
    cameras = tuple({streams[k].camera for k in used.values()} - {""})
    return Source(path, sizes.pop(), events, frames, span_us, details, topics=cameras)


class _Stream(NamedTuple):
    """What the header says of a stream: what it holds, the sensor's size, and the camera's name."""

    kind: str
    size_px: tuple[int, int]
    camera: str


def _chosen(path: Path, streams: dict[int, _Stream], wanted: int | str | None) -> dict[str, int]:
    """The numbers of the streams of events and of frames of one camera, by kind."""
    if wanted is not None:
        wanted = int(wanted) if str(wanted).isdecimal() else wanted
    seen = {k: s for k, s in streams.items() if s.kind in ("EVTS", "FRME")}
    if wanted is not None and wanted not in seen:
        raise ValueError(f"no events or frames in stream {wanted!r:.30}, but in {', '.join(map(str, seen))}")
    first = next(iter(seen), -1) if wanted is None else wanted
    used = {seen[k].kind: k for k in reversed(seen) if seen[k].camera == seen[first].camera}
    used |= {seen[first].kind: first} if seen else {}
    others = [f"{k} ({s.camera})" for k, s in seen.items() if k not in used.values()]
    if others and wanted is None:
        taken = f"{' and '.join(map(str, sorted(used.values())))} ({seen[first].camera})"
        left = f"not {', '.join(others):.200}; choose with --stream"
        warnings.warn(f"{path}: taking the streams {taken}, {left}", stacklevel=7)
    return used


def _header(path: Path) -> tuple[int, int, dict[int, _Stream]]:
    """Compression, where packets end (-1: cut off while recording), and the streams by number."""
    length = path.stat().st_size
    with path.open("rb") as file:
        magic = file.read(len(MAGIC))
        if old := re.match(rb"#!AER-DAT([123]\.\d)", magic):
            remedy = "convert it to AEDAT4 with the converter of iniVation's DV"
            raise InputError(f"{path}: AEDAT {old[1].decode()}, and only AEDAT4 is read; {remedy}")
        if magic != MAGIC:
            raise ValueError("empty file" if length == 0 else "not an AEDAT4 file, whatever its name says")
        (size,) = unpack("<I", file.read(4))
        if size > length - file.tell():
            raise ValueError("truncated in its header")
        if size > MAX_RECORD_BYTES:
            raise ValueError(f"a header of {size} bytes")
        header = Table(file.read(size), 0)
    compression, end, node = header.number(0, "<i"), header.number(1, "<q", -1), header.vector(2, "u1")
    if compression not in (0, *DECOMPRESSORS):
        raise ValueError(f"unknown compression {compression}")
    if end > length:
        raise ValueError(f"truncated: {length} bytes of more than {end}")
    streams = {}
    for stream in ElementTree.fromstring(node.tobytes()).iter("node"):
        values = {a.get("key"): a.text or "" for a in stream.findall("attr")}
        if "typeIdentifier" in values and stream.get("name", "").isdigit():
            inner = {a.get("key"): a.text or "" for a in stream.iter("attr")}
            size_px = int(inner.get("sizeX", 0)), int(inner.get("sizeY", 0))
            camera = inner.get("source", "")
            streams[int(stream.get("name", ""))] = _Stream(values["typeIdentifier"], size_px, camera)
    return compression, end, streams


def _whole_table(path: Path, at: int, compression: int) -> bool:
    """Whether the file ends with the table of packets: a size-prefixed flatbuffer, compressed."""
    if path.stat().st_size - at > MAX_RECORD_BYTES:
        raise ValueError("a table of packets that is too long")
    with path.open("rb") as file:
        file.seek(at)
        data = file.read()
    try:
        table = _decompress(data, compression)
        return len(table) == 4 + unpack("<I", table[:4])[0]
    except (ValueError, RuntimeError, zstd.ZstdError):
        return False


def _packets(path: Path, end: int, streams, wanted: int | None) -> Iterator[tuple[int, int]]:
    """Place and size of a stream's packets; of a recording that was cut off, of its whole packets."""
    stop = path.stat().st_size if end < 0 else end
    with path.open("rb") as file:
        file.seek(len(MAGIC))
        file.seek(unpack("<I", file.read(4))[0], os.SEEK_CUR)
        at = file.tell()
        while at + 8 <= stop:
            stream, size = unpack("<ii", file.read(8))
            whole = at + 8 + size <= stop
            if stream not in streams or not 0 < size <= MAX_CHUNK_BYTES or not (whole or end < 0):
                raise ValueError(f"damaged packet at byte {at}")
            if not whole:
                return
            if stream == wanted:
                yield at + 8, size
            at += 8 + size
            file.seek(at)
        if end >= 0 and at != end:
            raise ValueError(f"damaged packet before byte {end}")


def _contents(path: Path, compression: int, places: Iterable[tuple[int, int]]) -> Iterator[bytes]:
    with path.open("rb") as file:
        for at, size in places:
            file.seek(at)
            yield _decompress(file.read(size), compression)


def _stream(path: Path, number: int) -> Iterator[bytes]:
    compression, end, streams = _header(path)
    return _contents(path, compression, _packets(path, end, streams, number))


def _decompress(data: bytes, compression: int) -> bytes:
    if not compression:
        return data
    decompressor = DECOMPRESSORS[compression]()
    content = decompressor.decompress(data, max_length=MAX_CHUNK_BYTES)
    if not decompressor.eof:
        raise ValueError("a packet that does not decompress")
    return content


def _events(path: Path, stream: int) -> Iterator[np.ndarray]:
    return in_chunks(_events_of(content) for content in _stream(path, stream))


def _events_of(content: bytes) -> np.ndarray:
    packed = Table(content).vector(0, "V16")  # laid out like EVENT
    if packed.view("u1")[12::16].max(initial=0) > 1:
        raise ValueError("a packet with polarities other than 0 and 1")
    return packed.view(EVENT)


def _details(path: Path, kinds: list[str], frames: int | None) -> dict:
    """Kinds of the file's streams, and the median exposure of its first frames."""
    if frames is None:
        return {"streams": kinds}
    exposures_us = [
        Table(content).number(11, "<q") for content in islice(_stream(path, frames), FIRST_FRAMES)
    ]
    known = any(exposures_us)
    return {"streams": kinds, "exposure_ms": float(np.median(exposures_us)) / 1000 if known else None}


def _frames(path: Path, stream: int) -> Iterator[tuple[int, np.ndarray]]:
    for content in _stream(path, stream):
        frame = Table(content)
        kind, width, height = (frame.number(k, form) for k, form in ((5, "<b"), (6, "<h"), (7, "<h")))
        if kind not in CHANNELS:
            raise ValueError(f"a frame of unknown format {kind}")
        check_image(width, height)
        pixels = frame.vector(10, "u1").reshape(height, width, CHANNELS[kind])
        # stamped at the start of the exposure; ours is its middle
        yield frame.number(0, "<q") + round(frame.number(11, "<q") / 2), rgb(pixels)


def rgb(image: np.ndarray) -> np.ndarray:
    """Convert (H, W[, C]) BGR, BGRA or one channel, which is repeated, to RGB (H, W, 3)."""
    pixels = image if image.ndim == 3 else image[..., None]
    return np.ascontiguousarray(np.broadcast_to(pixels[..., 2::-1], (*image.shape[:2], 3)))
