"""An attached camera of iniVation, as `lmmap.recordings.devices` describes devices."""

from __future__ import annotations

import time
from collections.abc import Mapping

import dv_processing as dv

from lmmap.recordings.aedat4 import rgb
from lmmap.types import EVENT, InputError

from .flips import flip_events, flip_frame


class Attached:
    """The first camera that dv-processing finds; ``flips`` maps a modality to one of `flips.FLIPS`."""

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
        """The present time (us) on the camera's clock, which is synchronised with the first data."""
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
