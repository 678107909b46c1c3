"""How probable it is, by its covariance, that a pose is right."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtr

from ..settings import OURS, Settings
from ..types import Estimate


def probability_within_limits(estimate: Estimate, settings: Settings = OURS) -> float:
    """Probability that a pose is within ``right_position_m``, ``right_normal_rad`` and
    ``right_rotation_rad``.  It is not overstated: the three chances to miss add up.

    The square of an error with covariance C is taken as g times a chi-square variable of h degrees of
    freedom, with its mean g h = tr C and its variance 2 g^2 h = 2 tr C^2 (Satterthwaite 1946,
    doi 10.2307/3002019).
    """
    C, n = estimate.covariance, estimate.T_cam_port.normal
    across = np.eye(3) - np.outer(n, n)
    parts = [
        (settings.right_position_m, C[:3, :3]),
        (settings.right_normal_rad, across @ C[3:, 3:] @ across),
        (settings.right_rotation_rad, C[3:, 3:]),
    ]
    missed = 0.0
    for limit, block in parts:
        mean, spread = np.trace(block), np.sum(block * block.T)
        missed += 1 - chdtr(mean**2 / spread, limit**2 * mean / spread)
    return float(max(0.0, 1 - missed))
