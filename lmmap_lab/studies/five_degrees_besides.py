"""What Table I has besides the normal's noise: the yaw's, gross yaws, and gross outliers."""

from __future__ import annotations

import numpy as np

GROSS_DEG = 75.0  # tilt of the flattest ellipse that counts as a ring's


def mixture(near, far, rmse: float) -> tuple[float, float, float]:
    """The share of ``far`` values beside ``near`` ones that gives a root mean square, as well as a share can;
    and the mixture's median and root mean square."""
    square, far_square = np.mean(near**2), np.mean(far**2)
    share = np.clip((rmse**2 - square) / (far_square - square), 0, 1)
    values = np.r_[near, far]
    weights = np.repeat([(1 - share) / len(near), share / len(far)], [len(near), len(far)])
    median = np.quantile(values, 0.5, weights=weights, method="inverted_cdf")
    return float(share), float(median), float(np.sqrt((1 - share) * square + share * far_square))


def outliers_deg(count: int, rng: np.random.Generator) -> np.ndarray:
    """Angles (count,) between true normals and wrong ones, both anywhere up to `GROSS_DEG` from the sight."""
    tilt = np.arccos(rng.uniform(np.cos(np.deg2rad(GROSS_DEG)), 1, (2, count)))
    across = np.prod(np.sin(tilt), 0) * np.cos(rng.uniform(0, 2 * np.pi, count))
    return np.rad2deg(np.arccos(np.prod(np.cos(tilt), 0) + across))


def turn_rad(normal_rad, yaw_rad) -> np.ndarray:
    """Angle of a turn across the normal and one about it together: cos(r / 2) = cos(e / 2) cos(y / 2)."""
    return 2 * np.arccos(np.cos(normal_rad / 2) * np.cos(yaw_rad / 2))


def yaw_of(normal_deg, rotation, seed: int = 0) -> tuple[float, float, np.ndarray]:
    """Noise of the yaw (deg) and share of gross yaws with which normals that are off by (N,) deg, NaN where
    there is none, give a cell's median and RMSE (2,) of the rotation; and the log ratios (2,) that remain.

    Gross yaws are anywhere in a third of a turn, and last, so that the filter keeps them.
    """
    off_rad = np.deg2rad(normal_deg[np.isfinite(normal_deg)])
    rng = np.random.default_rng(seed)
    z, gross_rad = rng.standard_normal(len(off_rad)), rng.uniform(-np.pi / 3, np.pi / 3, len(off_rad))
    far = np.rad2deg(turn_rad(off_rad, gross_rad))

    def mixed(sigma_deg):
        return mixture(np.rad2deg(turn_rad(off_rad, np.deg2rad(sigma_deg) * z)), far, rotation[1])

    low, high = 0.0, 30.0
    for _ in range(14):
        middle = (low + high) / 2
        low, high = (middle, high) if mixed(middle)[1] < rotation[0] else (low, middle)
    share, *both = mixed(high)
    return high, share, np.log(both / np.asarray(rotation))
