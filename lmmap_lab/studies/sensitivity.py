"""How far the normal may turn before the image changes by one pixel, and the Cramer-Rao bound.

The first is the paper's theoretical limit, computed for every sensible reading of "one pixel".  The second is
the limit that statistics sets.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.stats import chi2

from lmmap.geometry.conics import circle_conic, circle_ellipse
from lmmap.pipeline import circle, ellipse
from lmmap.refinement import uncertainty
from lmmap.types import Camera, Pose

from .chart_errors import chart_nees

UNIT = Camera(1, 1, 1.0, 1.0, 0.0, 0.0)  # image coordinates before the focal length
CONTOUR = 72  # points


def minor_axis_px(distance_m, tilt_rad, focal_px: float, radius_m: float) -> np.ndarray:
    """Full minor axis of a circle on the optical axis, by exact perspective.

    The ends of the diameter along the tilt are at depths Z +- r sin(tilt), hence
    m = 2 f r Z cos(tilt) / (Z^2 - r^2 sin^2(tilt)).
    """
    Z, c = np.asarray(distance_m, float), np.cos(tilt_rad)
    return 2 * focal_px * radius_m * Z * c / (Z**2 - radius_m**2 * (1 - c**2))


def tilt_from_minor_axis_rad(distance_m, minor_px, focal_px: float, radius_m: float) -> np.ndarray:
    """Inverse of `minor_axis_px`: the root in [0, 1] of m r^2 c^2 - 2 f r Z c + m (Z^2 - r^2) = 0."""
    Z, m = np.asarray(distance_m, float), np.asarray(minor_px, float)
    half_b, product = focal_px * radius_m * Z, m**2 * radius_m**2 * (Z**2 - radius_m**2)
    c = m * (Z**2 - radius_m**2) / (half_b + np.sqrt(half_b**2 - product))
    return np.arccos(np.minimum(c, 1.0))


def explained_rotation_rad(
    distance_m, tilt_rad, focal_px: float, radius_m: float, pixels: float = 1.0
) -> np.ndarray:
    """Turn away from the camera that shortens the full minor axis by ``pixels``, at fixed distance.

    The reading of the paper's "one-pixel difference" that gives both of its numbers (8.9 deg
    fronto-parallel and about 1 deg at 45 deg, at 0.6 m) with one unknown, the ring's size in pixels.
    Arguments broadcast.

    Raises
    ------
    ValueError
        If the circle reaches the camera, a tilt is outside [0, 90 deg), or the minor axis is not
        longer than ``pixels``.
    """
    Z, tilt = np.asarray(distance_m, float), np.asarray(tilt_rad, float)
    if not (0 < radius_m < Z.min() and focal_px > 0):
        raise ValueError(f"distance_m: expected more than the radius, {radius_m} m, got {Z.min()} m")
    if not np.all((tilt >= 0) & (tilt < np.pi / 2)):
        raise ValueError(f"tilt_rad: expected [0, pi/2), got [{tilt.min()}, {tilt.max()}]")
    shorter = minor_axis_px(Z, tilt, focal_px, radius_m) - pixels
    if not (pixels >= 0 and np.all(shorter > 0)):
        raise ValueError(f"pixels: expected less than every minor axis, got {pixels}")
    return tilt_from_minor_axis_rad(Z, shorter, focal_px, radius_m) - tilt


def tilted_pose(distance_m, tilt_rad) -> Pose:
    """Circles on the optical axis, tilted about the camera's x axis; arguments broadcast."""
    Z, tilt = np.broadcast_arrays(np.asarray(distance_m, float), np.asarray(tilt_rad, float))
    c, s, o = np.cos(tilt), np.sin(tilt), np.zeros_like(tilt)
    rows = (o + 1, o, o), (o, -c, s), (o, -s, -c)
    rotation = np.stack([np.stack(row, -1) for row in rows], -2)
    return Pose(rotation, np.stack([o, o, Z], -1))


def displacements(before: Pose, after: Pose, radius_m: float) -> np.ndarray:
    """How far the contour moves across itself, at 72 of its points, (..., 72), in focal lengths."""
    points = circle_ellipse(before, radius_m, UNIT).points(CONTOUR)
    x = np.concatenate([points, np.ones_like(points[..., :1])], -1)
    Cx = x @ circle_conic(after, radius_m, UNIT)
    return np.sum(x * Cx, -1) / (2 * np.linalg.norm(Cx[..., :2], axis=-1))


def refit_pose(before: Pose, after: Pose, radius_m: float) -> Pose:
    """The pose ``after``, shifted without a turn so that its contour fits that of ``before`` best."""
    step = 1e-5 * before.position_m[..., 2]
    for _ in range(2):
        d = displacements(before, after, radius_m)
        shifted = [Pose(after.rotation, after.position_m + step[..., None] * e) for e in np.eye(3)]
        J = np.stack([displacements(before, T, radius_m) - d for T in shifted], -1) / step[..., None, None]
        move = np.linalg.pinv(J) @ d[..., None]
        after = Pose(after.rotation, after.position_m - move[..., 0])
    return after


def _axis(k, factor):
    def change(before, after, radius_m):
        a, b = (circle_ellipse(T, radius_m, UNIT).semi_axes_px[..., k] for T in (before, after))
        return factor * (a - b)

    return change


def _contour(reduce, refit):
    def change(before, after, radius_m):
        after = refit_pose(before, after, radius_m) if refit else after
        return reduce(np.abs(displacements(before, after, radius_m)), -1)

    return change


# every reading of "one pixel" tried: change in units of the focal length, of two poses and a radius
READINGS = {
    "full minor axis": _axis(1, 2.0),
    "semi-minor axis": _axis(1, 1.0),
    "contour, largest": _contour(np.max, False),
    "contour, mean": _contour(np.mean, False),
    "contour, largest, position refitted": _contour(np.max, True),
    "contour, mean, position refitted": _contour(np.mean, True),
}


def turn_rad(reading: str, distance_m, tilt_rad, focal_px: float, radius_m: float, pixels=1.0) -> np.ndarray:
    """Turn that changes the image by ``pixels`` under a reading of `READINGS`, by bisection; NaN where none
    up to 85 deg of tilt does.  Arguments broadcast."""
    if reading not in READINGS:
        raise ValueError(f"reading: expected one of {list(READINGS)}, got {reading!r}")
    Z, tilt = np.broadcast_arrays(np.asarray(distance_m, float), np.asarray(tilt_rad, float))
    if not (0 < radius_m < Z.min() and focal_px > 0):
        raise ValueError(f"distance_m: expected more than the radius, {radius_m} m, got {Z.min()} m")
    before = tilted_pose(Z, tilt)
    low, high = np.zeros(Z.shape), np.maximum(np.deg2rad(85.0) - tilt, 0)

    def change(turn):
        return READINGS[reading](before, tilted_pose(Z, tilt + turn), radius_m) * focal_px

    reached = change(high) >= pixels
    for _ in range(24):
        middle = (low + high) / 2
        above = change(middle) >= pixels
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return np.where(reached, high, np.nan)


def ring_for(reading: str, turn: float, distance_m: float, focal_px: float) -> float:
    """Radius (m) of the ring for which, head-on, one pixel is worth a turn (rad), by bisection; NaN if
    none up to half the distance is."""
    low, high = 1e-3 * distance_m, 0.5 * distance_m
    for _ in range(20):
        middle = (low + high) / 2
        worth = turn_rad(reading, distance_m, 0.0, focal_px, middle)
        low, high = (middle, high) if not worth < turn else (low, middle)
    return high if high < 0.499 * distance_m else np.nan


def cramer_rao(T_cam_port: Pose, radius_m: float, camera: Camera, count: int, sigma_px: float):
    """Least RMS errors (normal in rad, position in m) that ``count`` contour points with independent noise
    allow when the right one of the two poses is known; near head-on, where the tilt's bound diverges, the
    RMS over the disc that `uncertainty` describes."""
    points = circle_ellipse(T_cam_port, radius_m, camera).points(count)
    known = uncertainty.pose_uncertainty(T_cam_port, points, sigma_px, radius_m, camera, merged=0.0)
    return np.sqrt(np.trace(known.covariance[3:, 3:])), np.sqrt(np.trace(known.covariance[:3, :3]))


def monte_carlo(tilts_deg, trials: int, camera: Camera, radius_m: float, rng: np.random.Generator,
                distance_m=0.6, count=250, sigma_px=0.5) -> pd.DataFrame:  # fmt: skip
    """Noisy contours, fitted and solved: RMS error of the normal (nearer branch) beside its bound, and how
    often the truth lies in the 95 % region of the cone's chart."""
    rows = []
    for tilt_deg in tilts_deg:
        T = tilted_pose(distance_m, np.deg2rad(tilt_deg))
        points = circle_ellipse(T, radius_m, camera).points(count)
        off, nees = np.zeros(trials), np.zeros(trials)
        for k in range(trials):
            noisy = points + sigma_px * rng.standard_normal(points.shape)
            fitted = ellipse.fit(noisy)
            pair = circle.poses(fitted, camera, radius_m)
            best = pair[int(np.argmax(pair.normal @ T.normal))]
            off[k] = np.arctan2(np.linalg.norm(np.cross(best.normal, T.normal)), best.normal @ T.normal)
            J = uncertainty.information(best, fitted.points(count), radius_m, camera)
            nees[k] = chart_nees(best, T, np.linalg.inv(J) * sigma_px**2, radius_m, camera)
        rms, bound = np.sqrt(np.mean(off**2)), cramer_rao(T, radius_m, camera, count, sigma_px)[0]
        inside = 100 * np.mean(nees < chi2.ppf(0.95, 5))
        rows.append((tilt_deg, np.rad2deg(rms), np.rad2deg(bound), rms / bound, nees.mean(), inside))
    columns = ["tilt_deg", "rms_deg", "bound_deg", "rms_over_bound", "mean_nees", "inside_95_percent"]
    return pd.DataFrame(rows, columns=columns)
