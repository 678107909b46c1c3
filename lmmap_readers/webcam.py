"""Any camera that OpenCV opens, by its number, its device or its address (`lmmap.recordings.devices`)."""

from __future__ import annotations

import math
import threading
import time
import warnings
from collections.abc import Mapping
from pathlib import Path

import cv2

from lmmap.types import Camera, InputError

from .flips import flip_frame

ASSUMED_VIEW_DEG = 60.0  # across the longer side of the image, as many webcams have
FIRST_IMAGE_S, SILENCE_S = 10.0, 60.0  # patience with a camera that sends nothing


class Webcam:
    """A camera whose images a thread takes as they arrive, so that none waits in the driver.

    The newest image is kept.  An image's time is that of its arrival on this computer's monotonic clock.
    """

    def __init__(self, name: str, flips: Mapping[str, str] | None = None):
        self._name, self._flip = name, (flips or {}).get("rgb")
        self._capture = cv2.VideoCapture(int(name) if name.isdigit() and int(name) < 2**31 else name)
        if not self._capture.isOpened():
            raise InputError(f"{name}: {_why_not(name)}")
        self._times_us, self._newest, self._over = [], None, False
        self._lock, self._heard_s = threading.Lock(), time.monotonic()
        threading.Thread(target=self._take, daemon=True).start()
        while self._newest is None:
            if self._over or time.monotonic() - self._heard_s > FIRST_IMAGE_S:
                raise InputError(f"{name}: the camera sends no image; close other programs that use it")
            time.sleep(0.01)
        self.size_px = self._newest.shape[1::-1]

    def _take(self) -> None:
        while True:
            good, bgr = self._capture.read()
            if good:
                with self._lock:
                    self._times_us.append(self.now_us())
                    self._newest = bgr
            elif self._capture.get(cv2.CAP_PROP_FRAME_COUNT) > 0:  # the end of a file behind an address
                self._over = True
                return
            else:
                time.sleep(0.1)

    def now_us(self) -> int:
        return time.monotonic_ns() // 1000

    def running(self) -> bool:
        return not self._over or bool(self._times_us)

    def pending(self, modality: str) -> list:
        """The times (us) of all images since the last call, each with the newest image (H, W, 3); raises
        `InputError`."""
        if modality != "rgb":
            raise InputError(f"{self._name}: is no event camera; give --modality rgb")
        with self._lock:
            (times_us, self._times_us), bgr = (self._times_us, []), self._newest
        if times_us:
            self._heard_s = time.monotonic()
            rgb = cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB)
            return [(t_us, flip_frame(rgb, self._flip) if self._flip else rgb) for t_us in times_us]
        if time.monotonic() - self._heard_s > SILENCE_S:
            raise InputError(f"{self._name}: the camera sent no image for {SILENCE_S:.0f} s; check its cable")
        return []


def _why_not(name: str) -> str:
    """What is wrong with a camera that cannot be opened, and what to do."""
    device = f"/dev/video{name}" if name.isdigit() else name
    if "://" in name:
        return "nothing can be read from this address; check it in a browser or a player"
    if Path(device).exists():
        return "cannot open this camera; close other programs that use it, or join the group 'video'"
    here = ", ".join(sorted(map(str, Path("/dev").glob("video*")))) or "no camera at all"
    return f"no such camera, there is {here}; attach one, or name a video"


def assumed(size_px: tuple[int, int], name) -> Camera:
    """Assume a camera of which only the images' size is known, and warn of what that means."""
    width, height = size_px
    f_px = max(size_px) / 2 / math.tan(math.radians(ASSUMED_VIEW_DEG / 2))
    view = f"{ASSUMED_VIEW_DEG:.0f} degrees of horizontal view, f = {f_px:.0f} px"
    warnings.warn(f"{name}: no calibration; assuming {view}: distances are off by as "
                  "many percent as f, angles by less; 'lmmap calibrate CLIP --focal' measures f, and "
                  "--camera gives it", stacklevel=3)  # fmt: skip
    return Camera(width, height, f_px, f_px, (width - 1) / 2, (height - 1) / 2)
