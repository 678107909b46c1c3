"""Devices that are read live: here a recording, played at its own speed; other packages add cameras.

A device has ``size_px``, ``running()``, ``now_us()`` and ``pending(modality)``, which returns what has come
since the last call: chunks of events, or ``(t_us, frame)``.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from .stream import Stream

LONGEST_GAP_S = 10.0  # of a recording that is played: a longer one is passed over


class Played:
    """A stream played in real time; its clock starts at the first call of `pending` and skips long gaps."""

    def __init__(self, stream: Stream, clock: Callable[[], float] = time.monotonic):
        self.size_px = stream.camera.size_px
        self._clock, self._first_us = clock, 0
        self._start_s: Any = None  # until the first data
        self._sources = {"event": stream.chunks(), "rgb": stream.timed_frames()}
        self._held: Any = None  # what is not due yet
        self._over = self._warned = False

    def now_us(self) -> int:
        """The present time (us) in the recording."""
        return self._first_us + round((self._clock() - self._start_s) * 1e6)

    def running(self) -> bool:
        return not self._over

    def pending(self, modality: str) -> list:
        due: list = []
        source: Any = self._sources[modality]
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
            warnings.warn(f"live: nothing for {gap_s:.0f} s of the recording; skipping them", stacklevel=4)
        self._start_s, self._first_us = self._clock(), next_us
