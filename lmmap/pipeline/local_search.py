"""The ring's ellipse among clutter: five points of one neighbourhood, ranked by the mask's contrast.

`ellipse.fit_ransac` draws points from the whole image and counts inliers.  Where most of a mask is clutter,
five points of the ring rarely come together, and a long edge has more inliers than the ring.  Here the points
of a hypothesis lie within one radius, and what counts is that the mask is high along the ellipse and low both
inside and outside it.
"""

from __future__ import annotations

from typing import Any, cast

import cv2
import numpy as np

from ..geometry.conic_fit import five_point_conics, normalise, sampson_distance, sampson_fit, to_pixels
from ..geometry.conics import conic_matrix, ellipse_from_conic
from ..geometry.projection import distort_points
from ..settings import OURS, Settings
from ..types import Camera, Ellipse
from .ellipse import arc_coverage

RADIUS_PX = (20.0, 120.0)  # of a neighbourhood: from the smallest ring's size to the largest one's
DRAWS = 64  # points looked at for the four neighbours of a seed
ON, INSIDE, OUTSIDE = (0.95, 1.0, 1.05), (0.70, 0.74, 0.78), (1.22, 1.27, 1.32)  # of the axes
CONTOUR_POINTS = 36


def fit_local(
    points_px, mask, rng: np.random.Generator, camera: Camera, settings: Settings = OURS
) -> tuple[Ellipse | None, np.ndarray]:
    """Fit the ellipse of highest `contrast` through points of one neighbourhood; return it and its inliers.

    Parameters
    ----------
    points_px : (M, 2)
        Points of the mask's skeleton, undistorted.
    mask : (H, W), values in [0, 1], as the camera saw it

    Returns
    -------
    ellipse, inliers
        The ellipse, or None if none passes the gates on contrast, axis ratio, size and arc coverage; and
        which points (M,) lie on it.
    """
    points, mask = np.asarray(points_px, float).reshape(-1, 2), np.asarray(mask, np.float32)
    nothing = None, np.zeros(len(points), bool)
    if len(points) < 5 or np.ptp(points, 0).max() == 0:
        return nothing
    x, centre_px, scale_px = normalise(points)
    tolerance = settings.ransac_tolerance_px / scale_px
    theta = five_point_conics(x, neighbour_samples(points, rng, settings.ransac_hypotheses))
    theta, ellipses = _plausible(theta, centre_px, scale_px, settings)
    theta = theta[np.argsort(-contrast(ellipses, mask, camera), kind="stable")[: settings.ransac_refits]]
    for widening in (2.0, 1.5, 1.0, 1.0, 1.0):
        inlier = np.abs(sampson_distance(theta, x)) < widening * tolerance
        theta = sampson_fit(theta, x, inlier, steps=1)
    theta, ellipses = _plausible(theta, centre_px, scale_px, settings)
    contrasts = contrast(ellipses, mask, camera)
    for k in np.argsort(-contrasts, kind="stable"):
        best = Ellipse(ellipses.centre_px[k], ellipses.semi_axes_px[k], ellipses.angle_rad[k])
        inliers = np.abs(sampson_distance(theta[k], x)) < tolerance
        if contrasts[k] < settings.min_contrast:
            break
        if arc_coverage(best, points[inliers]) >= settings.min_arc_coverage:
            return best, inliers
    return nothing


def neighbour_samples(points_px, rng: np.random.Generator, count: int) -> np.ndarray:
    """Indices (K <= count, 5) of points (M, 2) that lie within one radius of the first of the five.

    The radius is drawn log-uniformly from `RADIUS_PX`.  Seeds with fewer than four neighbours among `DRAWS`
    random points are left out.
    """
    seed = rng.integers(0, len(points_px), count)
    radius_px = np.exp(rng.uniform(*cast(tuple[float, float], np.log(RADIUS_PX)), count))
    drawn = rng.integers(0, len(points_px), (count, DRAWS))
    offset = points_px[drawn] - points_px[seed][:, None]
    near = np.sum(offset**2, -1) < radius_px[:, None] ** 2
    first_near = np.argsort(~near, 1, kind="stable")[:, :4]
    samples = np.column_stack([seed, np.take_along_axis(drawn, first_near, 1)])
    return samples[near.sum(1) >= 4]


def contrast(ellipse: Ellipse, mask, camera: Camera) -> np.ndarray:
    """Mean of a mask (H, W) along undistorted ellipses (K,), minus the average of its means just inside and
    outside them, in [-1, 1], shape (K,)."""
    scale = np.array([*ON, *INSIDE, *OUTSIDE])[:, None, None]
    centre = ellipse.centre_px[..., None, :]
    offset = ellipse.points(CONTOUR_POINTS) - centre
    grid = distort_points(centre[..., None, :] + scale * offset[..., None, :, :], camera)
    flat = grid.reshape(-1, CONTOUR_POINTS, 2).clip(-10, 30_000).astype(np.float32)
    if not len(flat):
        return np.zeros(grid.shape[:-3])
    value = cv2.remap(np.asarray(mask, np.float32), flat, cast(Any, None), cv2.INTER_LINEAR, borderValue=0.0)
    means = value.reshape(grid.shape[:-1]).mean(-1)
    on, inside, outside = (part.mean(-1) for part in np.split(means, 3, -1))
    return on - (inside + outside) / 2


def _plausible(theta, centre_px, scale_px: float, settings: Settings) -> tuple[np.ndarray, Ellipse]:
    """Those of conics (K, 6) that are ellipses of sensible shape and size, and these in pixels."""
    ellipse, real = ellipse_from_conic(conic_matrix(theta))
    major, minor = ellipse.semi_axes_px[:, 0], ellipse.semi_axes_px[:, 1]
    with np.errstate(invalid="ignore"):
        sensible = real & (minor >= settings.min_axis_ratio * major)
        sensible &= major * scale_px >= settings.min_semi_major_px
    kept = Ellipse(ellipse.centre_px[sensible], ellipse.semi_axes_px[sensible], ellipse.angle_rad[sensible])
    return theta[sensible], to_pixels(kept, centre_px, scale_px)
