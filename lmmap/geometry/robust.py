"""Robust statistics: medians, and Tukey's weights of residuals."""

from __future__ import annotations

import numpy as np

from .compiled import njit

TUKEY = 4.7  # robust standard deviations beyond which a residual counts for nothing


@njit(nogil=True)
def median(values) -> float:
    """Median of values (M,); `np.median` takes ten times longer for a few hundred."""
    return np.median(values)


def tukey_cut(residuals, least_sigma: float = 1e-9) -> float:
    """`TUKEY` standard deviations of residuals (M,) about 0, estimated from their median magnitude; the
    standard deviation is at least ``least_sigma``."""
    return TUKEY * max(1.48 * median(np.abs(residuals)), least_sigma)


def tukey_weights(residuals, cut: float) -> np.ndarray:
    """Tukey's weights (M,) of residuals, from 1 at zero down to 0 at ``cut`` and beyond."""
    return np.maximum(1 - (residuals / cut) ** 2, 0) ** 2
