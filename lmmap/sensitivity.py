"""How far one pixel lets the normal turn: the paper's theoretical limit of the model."""

from __future__ import annotations

import numpy as np


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
