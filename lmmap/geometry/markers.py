"""Points on a port's markers: spread over them, and on polar coordinates of their plane."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ..types import Port, check_number, frozen_array

LEAST_YAW_STEP_RAD = 1e-3  # a tenth of what a yaw is known to; memory grows as the step gets smaller


def reach_m(port: Port) -> float:
    """Radius about the port's axis within which the markers lie, and a little more."""
    tangential, depth = np.array(port.marker_size_m) / 2
    return float(1.1 * np.hypot(port.marker_radius_m + depth, tangential))


def check_yaw_step(port: Port, yaw_step_rad: float) -> None:
    """ValueError unless a step fits the period of the port's yaw, and not too often."""
    check_number("yaw_step_rad", yaw_step_rad, LEAST_YAW_STEP_RAD, 1.001 * port.yaw_period_rad)


@lru_cache
def polar_template(port: Port, yaw_step_rad: float, radial: int = 16):
    """Points on polar coordinates of the markers' plane (R, A, 3), over the full turn; the marker at yaw 0
    folded over one period, (R, A / symmetry), weighted by the polar area element; the step in yaw."""
    per_period = round(port.yaw_period_rad / yaw_step_rad)
    step_rad = port.yaw_period_rad / per_period
    angles = np.arange(per_period * port.symmetry) * step_rad
    tangential, depth = np.array(port.marker_size_m) / 2
    near, far = port.marker_radius_m - depth, port.marker_radius_m + depth
    radii = np.linspace(0.8 * near, reach_m(port), radial)
    x, y = np.multiply.outer(radii, np.cos(angles)), np.multiply.outer(radii, np.sin(angles))
    marker = (x >= near) & (x <= far) & (np.abs(y) <= tangential)
    template = (marker * radii[:, None]).reshape(radial, port.symmetry, per_period).sum(1)
    points_m = np.stack([x, y, np.full_like(x, port.plate_height_m)], -1)
    return frozen_array(points_m), frozen_array(template), step_rad


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
