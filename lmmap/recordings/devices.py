"""What is read as it comes: an attached camera, or a recording played in the time that it took.

A device has ``size_px``, ``running()``, ``now_us()`` and ``pending(modality)``, what has come since the last
call: chunks of events, or ``(t_us, frame)``.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Mapping

import dv_processing as dv
import numpy as np

from ..types import EVENT, InputError
from .aedat4 import rgb
from .flips import flip_events, flip_frame
from .stream import Stream

LONGEST_GAP_S = 10.0  # of a recording that is played: a longer one is passed over


class Played:
    """A stream in real time; its clock starts at the first call of `pending`, and jumps over long gaps."""

    def __init__(self, stream: Stream, clock: Callable[[], float] = time.monotonic):
        self.size_px = stream.camera.size_px
        self._clock, self._start_s, self._first_us = clock, None, None
        self._sources = {"event": stream.chunks(), "rgb": stream.timed_frames()}
        self._held = None  # what is not due yet
        self._over = self._warned = False

    def now_us(self) -> int:
        """Time of the recording now."""
        return self._first_us + round((self._clock() - self._start_s) * 1e6)

    def running(self) -> bool:
        return not self._over

    def pending(self, modality: str) -> list:
        due, source = [], self._sources[modality]
        while True:
            if self._held is None:
                self._held = next(source, None)
                if self._held is None:
                    self._over = True
                    return due
            self._keep_time(int(self._held["t_us"][0] if modality == "event" else self._held[0]))
            if modality == "rgb":
                if self._held[0] > self.now_us():
                    return due
                due.append(self._held)
                self._held = None
                continue
            k = int(np.searchsorted(self._held["t_us"], self.now_us(), side="right"))
            due.append(self._held[:k])
            if k < len(self._held):
                self._held = self._held[k:]
                return due
            self._held = None

    def _keep_time(self, next_us: int) -> None:
        """Start the clock at the first data, and anew behind a gap that nobody wants to wait for.

        A warning names the first gap.
        """
        if self._start_s is not None and next_us - self.now_us() <= LONGEST_GAP_S * 1e6:
            return
        if self._start_s is not None and not self._warned:
            self._warned = True
            gap_s = (next_us - self.now_us()) * 1e-6
            warnings.warn(f"live: nothing for {gap_s:.0f} s of the recording; passed over", stacklevel=4)
        self._start_s, self._first_us = self._clock(), next_us


class Attached:
    """The first camera that dv-processing finds, its images flipped as `flips.FLIPS` has it."""

    def __init__(self, flips: Mapping[str, str] | None = None):
        if not dv.io.camera.discover():
            raise InputError("live: no camera found; attach one, or name a recording to play in real time")
        try:
            self._device = dv.io.camera.open()
        except RuntimeError as error:  # in use, or no permission
            reason = (str(error).splitlines() or ["no reason given"])[0]
            raise InputError(f"live: cannot open the camera ({reason}); close other viewers") from None
        self.size_px = tuple(self._device.getEventResolution())
        self._offset_us, self._flips = None, flips or {}

    def now_us(self) -> int:
        """Now, in the camera's time; its clock is read off the first data."""
        return time.monotonic_ns() // 1000 + (self._offset_us or 0)

    def running(self) -> bool:
        return self._device.isRunning()

    def pending(self, modality: str) -> list:
        if modality == "event":
            batches = iter(self._device.getNextEventBatch, None)
            data = [b.numpy().view("V16").view(EVENT) for b in batches if not b.isEmpty()]
            newest_us = data[-1]["t_us"][-1] if data else None
        else:
            data = [(f.timestamp, rgb(f.image)) for f in iter(self._device.getNextFrame, None)]
            newest_us = data[-1][0] if data else None
        if newest_us is not None and self._offset_us is None:
            self._offset_us = int(newest_us) - time.monotonic_ns() // 1000
        if (flip := self._flips.get(modality)) and modality == "event":
            return [flip_events(e, flip, self.size_px) for e in data]
        return [(t_us, flip_frame(frame, flip)) for t_us, frame in data] if flip else data
