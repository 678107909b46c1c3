"""Event frames: images of a fixed number of events, whatever their polarity."""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit


def event_frame(x, y, size_px: tuple[int, int], count_limit: int, blur_px: float) -> np.ndarray:
    """Image (H, W) of events at pixels ``x``, ``y``: counts, limited and blurred.

    The number of events is fixed, not their time, so the frame is as sharp in fast motion as in slow.
    """
    counts = np.zeros(size_px[::-1], np.float32)
    _count(counts, x, y, count_limit)
    return cv2.GaussianBlur(counts, (0, 0), blur_px) if blur_px else counts


@njit(cache=True, nogil=True)
def _count(counts, x, y, limit):
    for k in range(len(x)):
        counts[y[k], x[k]] = min(counts[y[k], x[k]] + 1.0, limit)
