"""One picture as a recording of one frame, and a folder of pictures that have no times of their own."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import cv2
import numpy as np

from .images import IMAGE_SUFFIXES, images_from, read_image
from .stream import Source, input_errors


def read_picture(path: Path) -> Source:
    """A frame at time zero; raises `InputError`."""
    return _sequence(path, [path], 1.0)


def read_numbered(path: Path, fps: float) -> Source:
    """A folder's pictures in the order of their names, ``fps`` to the second; raises `InputError`."""
    with _picture_errors(path):
        if not 0 < fps < 1e6:
            raise ValueError(f"{fps:g} pictures per second")
        names = sorted(p for p in path.iterdir() if p.suffix.lower() in IMAGE_SUFFIXES)
        if not names:
            raise ValueError(f"no {', '.join(IMAGE_SUFFIXES)} in it")
    return _sequence(path, names, fps)


def _sequence(path: Path, names: list[Path], fps: float) -> Source:
    with _picture_errors(path):
        first = read_image(names[0])
    span_us = 0, round((len(names) - 1) * 1e6 / fps)
    frames = partial(_frames, path, names, fps, first)
    return Source(path, first.shape[1::-1], frames=frames, span_us=span_us)


def _frames(path: Path, names: list[Path], fps: float, first: np.ndarray):
    with _picture_errors(path):
        for k, image in enumerate(images_from(first, names)):
            yield round(k * 1e6 / fps), image


def _picture_errors(path: Path):
    return input_errors(path, "cannot read this picture", "give 8-bit PNG or JPEG files", (cv2.error,))
