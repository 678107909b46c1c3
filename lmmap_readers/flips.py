"""Flip images and events of sensors that are mounted mirrored or turned to the view of their calibration."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from lmmap.settings import MODALITIES
from lmmap.types import InputError

FLIPS = {"x": (-1, 1), "y": (1, -1), "180": (-1, -1)}  # what columns and rows are multiplied by


def flip_frame(frame: np.ndarray, flip: str) -> np.ndarray:
    """Mirror a frame (H, W, 3) along its rows (x), its columns (y), or both (180)."""
    x, y = FLIPS[flip]
    return np.ascontiguousarray(frame[::y, ::x])


def flip_events(events: np.ndarray, flip: str, size_px: tuple[int, int]) -> np.ndarray:
    """Mirror events (M,) EVENT on a sensor of (width, height) in the same way."""
    events = events.copy()
    for name, sign, size in zip("xy", FLIPS[flip], size_px, strict=True):
        if sign < 0:
            events[name] = size - 1 - events[name]
    return events


def of_cameras(asked: Iterable[str]) -> dict[str, str]:
    """The flip for each modality, from texts such as ``event:x``, or ``x`` for both; raises `InputError`."""
    flips: dict[str, str] = {}
    for text in asked:
        camera, _, flip = text.rpartition(":")
        for m in (camera,) if camera else MODALITIES:
            if m in flips:
                already = f"{m} images have the flip {flips[m]} already"
                raise InputError(f"--flip {text}: {already}; give one for each camera, 180 for x and y")
            flips[m] = flip
    return flips
