"""Points on a port's markers: spread over them, and on a polar grid in their plane."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ..types import Port, check_number, frozen_array

LEAST_YAW_STEP_RAD = 1e-3  # a tenth of what a yaw is known to; memory grows as the step gets smaller


def reach_m(port: Port) -> float:
    """Radius (m) about the port's axis within which the markers lie, plus a small margin."""
    tangential, depth = np.array(port.marker_size_m) / 2
    return float(1.1 * np.hypot(port.marker_radius_m + depth, tangential))


def check_yaw_step(port: Port, yaw_step_rad: float) -> None:
    """Raise ValueError unless a yaw step is from `LEAST_YAW_STEP_RAD` to the period of the port's yaw."""
    check_number("yaw_step_rad", yaw_step_rad, LEAST_YAW_STEP_RAD, 1.001 * port.yaw_period_rad)


def polar_grid(port: Port, radii_m, height_m: float, yaws: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (R, A, 3) on circles of these radii (R,) in a plane at a height, with ``yaws`` points per yaw
    period; and their angles (A,) about the port's axis."""
    angle_rad = np.arange(yaws * port.symmetry) * (port.yaw_period_rad / yaws)
    x, y = (np.multiply.outer(radii_m, f(angle_rad)) for f in (np.cos, np.sin))
    return frozen_array(np.stack([x, y, np.full_like(x, height_m)], -1)), angle_rad


@lru_cache
def polar_template(port: Port, yaw_step_rad: float, radial: int = 16):
    """Points (R, A, 3) on a polar grid in the markers' plane, over the full turn; the marker at yaw 0 folded
    over one period, (R, A / symmetry), weighted by the polar area element; the yaw step (rad)."""
    per_period = round(port.yaw_period_rad / yaw_step_rad)
    tangential, depth = np.array(port.marker_size_m) / 2
    near, far = port.marker_radius_m - depth, port.marker_radius_m + depth
    radii_m = np.linspace(0.8 * near, reach_m(port), radial)
    points_m, _ = polar_grid(port, radii_m, port.plate_height_m, per_period)
    x, y, _ = np.moveaxis(points_m, -1, 0)
    marker = (x >= near) & (x <= far) & (np.abs(y) <= tangential)
    template = (marker * radii_m[:, None]).reshape(radial, port.symmetry, per_period).sum(1)
    return points_m, frozen_array(template), port.yaw_period_rad / per_period


@lru_cache
def template_spectrum(port: Port, yaw_step_rad: float) -> np.ndarray:
    """Conjugate spectrum (R, F) along the yaw of `polar_template`'s marker, the factor in a circular
    correlation."""
    return frozen_array(np.conj(np.fft.rfft(polar_template(port, yaw_step_rad)[1])), complex)


corners_m = lru_cache(Port.marker_corners_m)


@lru_cache
def marker_points_m(port: Port, tangential: int = 24, radial: int = 8):
    """Points spread evenly over the markers, shape (symmetry, radial * tangential, 3)."""
    corners = corners_m(port)
    s, t = ((np.arange(n) + 0.5) / n for n in (radial, tangential))
    along, across = corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0]
    grid = (
        corners[:, 0][:, None, None]
        + s[:, None, None] * along[:, None, None]
        + t[None, :, None] * across[:, None, None]
    )
    return frozen_array(grid.reshape(len(corners), -1, 3))
