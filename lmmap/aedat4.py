"""AEDAT4 (iniVation's format, through dv-processing): bytes on disk to arrays, and back."""

from __future__ import annotations

import os
import re
import struct
from collections import deque
from functools import partial
from pathlib import Path

import dv_processing as dv
import numpy as np

from .core import EVENT, InputError, Recording
from .streams import Source, naming, no_events, no_frames, pieces, rechunked

PACKET = 100_000  # events


REMEDY = "record or copy the file again"


def read(path: Path) -> Source:
    """What is in a file; raises `InputError`.

    Values are as stored: nothing here checks the order of time or the range of coordinates.
    """
    with _naming(path):
        if fault := _fault(path):
            raise InputError(f"{path}: {fault}; {REMEDY}")
        reader = dv.io.MonoCameraRecording(str(path))
        sizes = []
        if has_events := reader.isEventStreamAvailable():
            sizes.append(tuple(reader.getEventResolution()))
        if has_frames := reader.isFrameStreamAvailable():
            sizes.append(tuple(reader.getFrameResolution()))
        if not sizes or sizes[0] != sizes[-1]:
            raise InputError(f"{path}: expected events or frames of one size, found sizes {sizes}; {REMEDY}")
        first_us, last_us = reader.getTimeRange()
        return Source(
            path,
            sizes[0],
            partial(_events, path) if has_events else no_events,
            partial(_frames, path) if has_frames else no_frames,
            (first_us, last_us) if 0 <= first_us < last_us else None,
        )


def _events(path: Path):
    with _naming(path):
        reader = dv.io.MonoCameraRecording(str(path))
        batches = iter(reader.getNextEventBatch, None)
        # the library's 16-byte records are laid out like EVENT
        yield from rechunked(batch.numpy().view("V16").view(EVENT) for batch in batches)


def _frames(path: Path):
    with _naming(path):
        for image in iter(dv.io.MonoCameraRecording(str(path)).getNextFrame, None):
            # the library stamps the start of the exposure
            yield image.timestamp + round(image.exposure.total_seconds() * 5e5), rgb(image.image)


def rgb(image: np.ndarray) -> np.ndarray:
    """(H, W, 3) of the library's images: BGR, BGRA, or one channel, which is repeated."""
    pixels = image if image.ndim == 3 else image[..., None]
    return np.ascontiguousarray(np.broadcast_to(pixels[..., 2::-1], (*image.shape[:2], 3)))


def _naming(path: Path):
    return naming(path, "damaged AEDAT4", REMEDY, _reason)


def _fault(path: Path) -> str | None:
    """Walk the packet headers: the library may hang or crash on sizes that leave the file.

    Layout: magic, size-prefixed flatbuffer IOHeader, packets (int32 stream, int32 size, data), table.
    A recording that was cut off has no table (position -1); its whole packets still count.
    """
    magic = b"#!AER-DAT4.0\r\n"
    length = path.stat().st_size
    with path.open("rb") as file:
        if file.read(len(magic)) != magic:
            return "empty file" if length == 0 else "not an AEDAT4 file, whatever its name says"
        try:
            (size,) = struct.unpack("<I", file.read(4))
            if size > length - file.tell():
                return "truncated in its header"
            header = file.read(size)
            table = struct.unpack_from("<I", header)[0]
            vtable = table - struct.unpack_from("<i", header, table)[0]
            slot = struct.unpack_from("<H", header, vtable + 6)[0]  # second field of IOHeader
            end = struct.unpack_from("<q", header, table + slot)[0] if slot else -1
        except struct.error:
            return "damaged header"
        if end > length:
            return f"truncated: {length} bytes of more than {end}"
        streams = {int(n) for n in re.findall(rb'name="(\d{1,6})"', header)}
        stop = length if end < 0 else end
        while (at := file.tell()) + 8 <= stop:
            stream, size = struct.unpack("<ii", file.read(8))
            if stream not in streams or size < 0:
                return f"damaged packet at byte {at}"
            if at + 8 + size > stop:
                return None if end < 0 else f"damaged packet at byte {at}"
            file.seek(size, os.SEEK_CUR)
        return None if end < 0 or at == end else f"damaged packet before byte {end}"


def write(recording: Recording, path: Path) -> None:
    """Write events and frames (Zstandard); raises `OSError`."""
    # the library's writing thread aborts the process when the disk is full: claim the room first
    room = 2**20 + round(1.02 * (recording.events.nbytes + recording.frames.nbytes))
    with path.open("wb") as file:
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(file.fileno(), 0, room)
    config = dv.io.MonoCameraWriter.Config(recording.name, dv.CompressionType.ZSTD)
    config.addEventStream(recording.camera.size_px)
    config.addFrameStream(recording.camera.size_px)
    writer = dv.io.MonoCameraWriter(str(path), config)
    for chunk in recording.chunks():
        for e in pieces(chunk, PACKET):
            store = dv.EventStore()
            # one tuple an event is the library's fastest way in from Python; map() saves the loop
            deque(map(store.push_back, zip(*(e[name].tolist() for name in EVENT.names), strict=True)), 0)
            writer.writeEvents(store)
    for t_us, frame in recording.timed_frames():
        writer.writeFrame(dv.Frame(t_us, np.ascontiguousarray(frame[..., ::-1])))
    del writer  # closes the file


def _reason(error: Exception) -> str:
    """The library's errors are source locations with stack traces: keep what tells a user something."""
    lines = [re.sub(r"^.*?exceptions?\S*: *", "", line.strip()) for line in str(error).splitlines()]
    lines = [line for line in lines if line and not re.match(r"/project/|Stacktrace|\d+#", line)]
    return (lines or [type(error).__name__])[0]
