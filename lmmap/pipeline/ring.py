"""From the ring's mask to points: binarisation with hysteresis, then a skeleton one pixel wide."""

from __future__ import annotations

import numpy as np
from skimage.filters import apply_hysteresis_threshold
from skimage.morphology import skeletonize

from ..settings import OURS


def binarise(mask, threshold: float = OURS.mask_threshold, peak_share: float = OURS.peak_share) -> np.ndarray:
    """Pixels above the threshold, of those blobs that somewhere exceed ``peak_share`` times the mask's
    maximum.  Such hysteresis drops weak blobs and keeps the weak ends of strong ones."""
    mask = np.asarray(mask, np.float32)
    high = peak_share * mask.max(initial=0)
    return apply_hysteresis_threshold(mask, threshold, high) if high > threshold else mask > threshold


def skeleton_points(
    mask, threshold: float = OURS.mask_threshold, peak_share: float = OURS.peak_share
) -> np.ndarray:
    """Pixels (u, v), shape (M, 2), of the skeleton (Zhang & Suen 1984) of what `binarise` keeps: lines one
    pixel wide.

    Zhang's thinning of strokes of even width leaves them shifted by (-0.14, -0.14) px on average;
    `contour.trace` doesn't have that bias.
    """
    active = binarise(mask, threshold, peak_share)
    rows, columns = (np.flatnonzero(active.any(axis)) for axis in (1, 0))
    if not rows.size:
        return np.empty((0, 2))
    top, left = rows[0], columns[0]
    v, u = np.nonzero(skeletonize(active[top : rows[-1] + 1, left : columns[-1] + 1], method="zhang"))
    return np.column_stack([u + left, v + top]).astype(float)
