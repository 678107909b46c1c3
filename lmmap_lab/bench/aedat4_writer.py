"""Writes AEDAT4, iniVation's format, with iniVation's own library."""

from __future__ import annotations

import os
from collections import deque
from pathlib import Path

import dv_processing as dv
import numpy as np

from lmmap.recordings.stream import pieces
from lmmap.types import EVENT, Recording

PACKET = 100_000  # events in one


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
