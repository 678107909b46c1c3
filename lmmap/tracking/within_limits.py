"""What a pose's covariance says about it: its standard deviations, and the probability that it is right."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
from scipy.special import chdtr

from ..settings import OURS, Settings
from ..types import Estimate


def sigmas(estimate: Estimate) -> tuple[float, float]:
    """Standard deviations of the position (m) and of the normal (rad), each along its worst direction."""
    position, normal, _ = _covariances(estimate)
    worst = [np.linalg.eigvalsh(block)[-1] for block in (position, normal)]
    return cast(tuple[float, float], tuple(float(np.sqrt(max(w, 0))) for w in worst))


def is_certain(estimates: Sequence[Estimate], settings: Settings = OURS) -> np.ndarray:
    """Which estimates are certain by their covariance, shape (N,) bool: ``certain_sigmas`` times their
    `sigmas` are within the errors ``right_position_m`` and ``right_normal_rad``."""
    sure, limits = settings.certain_sigmas, (settings.right_position_m, settings.right_normal_rad)
    return np.array([e.T_cam_port is not None and np.all(sure * np.array(sigmas(e)) <= limits)
                     for e in estimates], bool)  # fmt: skip


def probability_within_limits(estimate: Estimate, settings: Settings = OURS) -> float:
    """Probability that a pose is within ``right_position_m``, ``right_normal_rad`` and
    ``right_rotation_rad``.  It is conservative, because the three probabilities of a miss are added.

    The square of an error with covariance C is taken as g times a chi-square variable of h degrees of
    freedom, with its mean g h = tr C and its variance 2 g^2 h = 2 tr C^2 (Satterthwaite 1946,
    doi 10.2307/3002019).
    """
    limits = settings.right_position_m, settings.right_normal_rad, settings.right_rotation_rad
    missed = 0.0
    for limit, C in zip(limits, _covariances(estimate), strict=True):
        mean, spread = np.trace(C), np.sum(C * C.T)
        missed += 1 - chdtr(mean**2 / spread, limit**2 * mean / spread)
    return float(max(0.0, 1 - missed))


def _covariances(estimate: Estimate) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Those (3, 3) of a pose's position, of its normal, and of its rotation."""
    assert estimate.covariance is not None and estimate.T_cam_port is not None
    C, n = estimate.covariance, estimate.T_cam_port.normal
    across = np.eye(3) - np.outer(n, n)
    return C[:3, :3], across @ C[3:, 3:] @ across, C[3:, 3:]
