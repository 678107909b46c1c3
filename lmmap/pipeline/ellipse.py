"""From the skeleton's points to an ellipse: RANSAC, ours and the paper's, and least-squares fits.

Whether points belong to an ellipse is measured by the Sampson distance throughout.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..geometry.conic_fit import (
    direct_fit,
    five_point_conics,
    normalise,
    sampson_distance,
    sampson_fit,
    to_pixels,
)
from ..geometry.conics import conic_matrix, ellipse_from_conic, monomials
from ..settings import OURS, Assumptions, Settings
from ..types import Ellipse, checked

SECTORS = 72  # of an arc: 5 degrees each
MAX_SPREADS = 1e4  # that an axis may have of its points' spread: longer, they are a parabola's or a line's


@checked
def fit(points_px: ArrayLike) -> Ellipse:
    """Fit the ellipse of least Sampson distance to points (M, 2), M >= 5, all of them inliers.

    Starts from the ellipse-specific algebraic fit (Halir & Flusser 1998).

    Raises
    ------
    ValueError
        If the points are fewer than five, not finite, or determine no ellipse.
    """
    points = _finite(points_px)
    if len(points) < 5:
        raise ValueError(f"points_px: expected shape (M >= 5, 2), got {points.shape}")
    x, centre, scale = normalise(points)
    theta = direct_fit(x)
    if theta is not None:
        theta = sampson_fit(theta, x, np.ones(len(x)))
        ellipse, real = ellipse_from_conic(conic_matrix(theta))
        if real and ellipse.semi_axes_px[0] <= MAX_SPREADS:
            return to_pixels(ellipse, centre, scale)
    raise ValueError("points_px: expected points of an ellipse, got none that determine one")


@checked
def fit_ransac(
    points_px: ArrayLike, rng: np.random.Generator, settings: Settings = OURS
) -> tuple[Ellipse | None, np.ndarray]:
    """Fit the ellipse through most of the points (M, 2); return it and which points lie on it (M,) bool.

    All hypotheses are evaluated at once: five-point conics of normalised points with A + C = 1, which
    no ellipse violates and no rotation changes; MSAC score of Sampson distances; refits of the best few
    with all their inliers.  Return None, and no inliers, if no ellipse passes the gates on axis ratio,
    size and arc coverage.

    Raises
    ------
    ValueError
        If the points have another shape or are not finite.
    """
    points = _finite(points_px)
    nothing = None, np.zeros(len(points), bool)
    if len(points) < 5 or np.ptp(points, 0).max() == 0:
        return nothing
    x, centre, scale = normalise(points)
    tolerance = settings.ransac_tolerance_px / scale
    theta = five_point_conics(x, rng.integers(0, len(x), (settings.ransac_hypotheses, 5)))
    theta = theta[_plausible(theta, settings)]
    theta = theta[np.argsort(_msac(theta, x, tolerance))[: settings.ransac_refits]]
    for widening in (2.0, 1.5, 1.0):
        inlier = np.abs(sampson_distance(theta, x)) < widening * tolerance
        theta = sampson_fit(theta, x, inlier, steps=1)
    for candidate in theta[np.argsort(_msac(theta, x, tolerance))]:
        candidate = _polish(candidate, x, tolerance)
        ellipse, real = ellipse_from_conic(conic_matrix(candidate))
        if not (real and _plausible(candidate, settings)):
            continue
        ellipse = to_pixels(ellipse, centre, scale)
        inliers = np.abs(sampson_distance(candidate, x)) < tolerance
        big = ellipse.semi_axes_px[0] >= settings.min_semi_major_px
        if big and arc_coverage(ellipse, points[inliers]) >= settings.min_arc_coverage:
            return ellipse, inliers
    return nothing


@checked
def paper_ransac(
    points_px: ArrayLike, rng: np.random.Generator, settings: Settings | Assumptions = OURS
) -> tuple[Ellipse | None, np.ndarray]:
    """The paper's RANSAC as printed: H times five points, A..E of equation 1 with F = 1 in raw pixels, check
    of the axis ratio, count of inliers, refit of the best hypothesis on its inliers.

    All H hypotheses are evaluated at once; the paper's loop gives the same.

    The paper doesn't say how it measures a point's distance; here it is the Sampson distance.

    Raises
    ------
    ValueError
        If the points have another shape or are not finite.
    """
    points = _finite(points_px)
    nothing = None, np.zeros(len(points), bool)
    if len(points) < 5:
        return nothing
    equations = monomials(points)[:, :5]
    draws = [rng.choice(len(points), 5, replace=False) for _ in range(settings.ransac_hypotheses)]
    samples = equations[np.array(draws)]
    samples = samples[np.linalg.det(samples) != 0]
    theta = np.linalg.solve(samples, -np.ones((len(samples), 5, 1)))[..., 0]
    theta = np.concatenate([theta, np.ones((len(theta), 1))], 1)
    theta = theta[_plausible(theta, settings)]
    if not len(theta):
        return nothing
    inliers = np.abs(sampson_distance(theta, points)) < settings.ransac_tolerance_px
    best = inliers[np.argmax(inliers.sum(1))]  # of equal counts the first, as a loop would keep it
    theta = np.append(np.linalg.lstsq(equations[best], -np.ones(best.sum()))[0], 1.0)
    ellipse, real = ellipse_from_conic(conic_matrix(theta))
    return (ellipse, best) if real else nothing


@checked
def arc_coverage(ellipse: Ellipse, points_px: ArrayLike) -> float:
    """Fraction of an ellipse's contour, in `SECTORS` of equal eccentric anomaly, that has points (M, 2)."""
    c, s = np.cos(ellipse.angle_rad), np.sin(ellipse.angle_rad)
    local = (_finite(points_px) - ellipse.centre_px) @ np.array([[c, -s], [s, c]])
    anomaly = np.arctan2(local[:, 1] / ellipse.semi_axes_px[1], local[:, 0] / ellipse.semi_axes_px[0])
    return len(np.unique(((anomaly / (2 * np.pi)) % 1 * SECTORS).astype(int) % SECTORS)) / SECTORS


def _finite(points_px):
    points = np.asarray(points_px, float)
    points = points if points.size else points.reshape(-1, 2)
    if points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(f"points_px: expected shape (M, 2), got {points.shape}")
    if not np.all(np.isfinite(points)):
        others = np.sum(~np.isfinite(points))
        raise ValueError(f"points_px: expected (M, 2) finite values, got {others} others")
    return points


def _msac(theta, x, tolerance: float):
    squared = np.square(distance := sampson_distance(theta, x), out=distance)
    return np.minimum(squared, tolerance**2, out=squared).sum(-1)


def _polish(theta, x, tolerance: float):
    """Alternate inliers and fit until they agree."""
    inlier = np.zeros(len(x), bool)
    for _ in range(5):
        now = np.abs(sampson_distance(theta, x)) < tolerance
        if now.sum() < 5 or np.array_equal(now, inlier):
            break
        inlier = now
        theta = sampson_fit(theta, x, inlier, steps=4)
    return theta


def _plausible(theta, settings: Settings | Assumptions):
    """Which conics are ellipses of sensible shape."""
    ellipse, real = ellipse_from_conic(conic_matrix(theta))
    with np.errstate(invalid="ignore"):
        return real & (ellipse.semi_axes_px[..., 1] >= settings.min_axis_ratio * ellipse.semi_axes_px[..., 0])
