"""Event Stream files, ``.es``, version 2: events of a DVS, as published at github.com/neuromorphic-paris.

An event is five bytes: the time since the last code and the polarity, then x and y.  One single-byte code
stands for 127 us without events, and another for nothing.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from lmmap.files import regular_file
from lmmap.recordings.stream import Source, in_chunks, reader
from lmmap.types import event_array

PIECE = 1 << 16  # bytes decoded at once
HEAD = struct.Struct("<12s3BBHH")  # signature, version, kind of events, width, height
SIGNATURE, DVS = b"Event Stream", 1
KINDS = {0: "generic", 1: "DVS", 2: "ATIS", 3: "asynchronous colour", 4: "colour"}
EVENT_BYTES = 5
SKIP, OVERFLOW, OVERFLOW_US = 0xFE, 0xFF, 127  # codes of one byte: nothing, and time without events


@reader("not an Event Stream of a DVS", "copy it again, or export it as AEDAT4 or CSV")
def read(path: Path) -> Source:
    """Read the events of an Event Stream, in the camera's own time; raises `InputError`."""
    with regular_file(path).open("rb") as file:
        head = file.read(HEAD.size)
        if not head.startswith(SIGNATURE) or len(head) < HEAD.size:
            raise ValueError(f"it does not begin with '{SIGNATURE.decode()}' and a size")
        _, major, minor, patch, kind, *size_px = HEAD.unpack(head)
        if major != 2:
            raise ValueError(f"version {major}.{minor}.{patch}, expected 2")
        if kind != DVS:
            raise ValueError(f"{KINDS.get(kind, f'unknown ({kind})')} events, expected those of a DVS")
        if 0 in size_px:
            raise ValueError(f"a sensor of {size_px[0]} x {size_px[1]} px")
    return Source(path, tuple(size_px), partial(_events, path, size_px[1]))


def _events(path: Path, height_px: int) -> Iterator[np.ndarray]:
    with path.open("rb") as file:
        file.seek(HEAD.size)
        yield from in_chunks(_decode(iter(lambda: file.read(PIECE), b""), height_px))


def _decode(runs: Iterator[bytes], height_px: int) -> Iterator[np.ndarray]:
    """Events of runs of bytes; ValueError, after all that are whole, where they end inside one."""
    last_us, rest = 0, b""
    for run in runs:
        data = np.frombuffer(rest + run, np.uint8)
        starts = _starts(data >= SKIP)
        whole = starts[(data[starts] >= SKIP) | (starts + EVENT_BYTES <= len(data))]
        rest = data[starts[len(whole)] :].tobytes() if len(whole) < len(starts) else b""
        code = data[whole].astype(np.int64)
        passed_us = np.where(code == OVERFLOW, OVERFLOW_US, np.where(code == SKIP, 0, code >> 1))
        t_us = last_us + np.cumsum(passed_us)
        last_us = int(t_us[-1]) if len(t_us) else last_us
        is_event = code < SKIP
        x, y = (data[whole[is_event, None] + 1 + np.arange(4)].view("<u2").astype(np.int64)).T
        # the format counts rows from below
        yield event_array(t_us[is_event], x, height_px - 1 - y, code[is_event] & 1)
    if rest:
        raise ValueError(f"it ends {len(rest)} bytes into an event of {EVENT_BYTES}")


def _starts(is_short: np.ndarray) -> np.ndarray:
    """Where codes begin in bytes (N,), the first at 0; short ones have one byte, events `EVENT_BYTES`.

    Each round doubles how many are known: to the first k codes it adds the k that follow them.
    """
    end = len(is_short)
    follower = np.minimum(np.arange(end) + np.where(is_short, 1, EVENT_BYTES), end)
    follower = np.append(follower, end)
    starts = np.zeros(1, np.int64)
    while starts[-1] < end:
        starts = np.concatenate([starts, follower[starts]])
        follower = follower[follower]
    return starts[starts < end]


read.what = "Event Stream of a DVS"
