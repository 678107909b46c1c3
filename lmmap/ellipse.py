"""From masks to ellipses: skeleton, conic fits, RANSAC, sub-pixel refinement.

Conics are coefficient vectors theta of the monomials (x^2, xy, y^2, x, y, 1), in coordinates that
are centred and scaled to unit spread unless a name says pixels.
"""

from __future__ import annotations

import cv2
import numpy as np
from skimage.morphology import skeletonize

from .core import PAPER, Ellipse, Settings
from .geometry import conic_from_ellipse, ellipse_from_conic


def skeleton_points(mask, threshold: float = PAPER.mask_threshold) -> np.ndarray:
    """Pixels (u, v) of the mask's one-pixel-wide skeleton (Zhang & Suen 1984), shape (M, 2).

    Zhang's thinning of strokes of even width leaves them shifted by (-0.14, -0.14) px on average;
    `refine_on_mask` doesn't have that bias.
    """
    v, u = np.nonzero(skeletonize(np.asarray(mask) > threshold, method="zhang"))
    return np.column_stack([u, v]).astype(float)


def fit(points_px) -> Ellipse:
    """Ellipse of least Sampson distance to points (M, 2), M >= 5, all of them inliers.

    Starts from the ellipse-specific algebraic fit (Halir & Flusser 1998).

    Raises
    ------
    ValueError
        If the points are fewer than five, not finite, or determine no ellipse.
    """
    points = np.asarray(points_px, float)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 5 or not np.all(np.isfinite(points)):
        raise ValueError(f"points_px: expected (M >= 5, 2) finite values, got shape {points.shape}")
    x, centre, scale = _normalise(points)
    theta = _direct(x)
    if theta is not None:
        theta = _refine(theta[None], x, np.ones((1, len(x))))[0]
        ellipse, real = ellipse_from_conic(_symmetric(theta))
        if real:
            return _to_pixels(ellipse, centre, scale)
    raise ValueError("points_px: expected points of an ellipse, got none that determine one")


def fit_ransac(
    points_px, rng: np.random.Generator, settings: Settings = PAPER
) -> tuple[Ellipse | None, np.ndarray]:
    """Ellipse through most of the points (M, 2), and which points lie on it (M,) bool.

    All hypotheses at once: five-point conics of normalised points with A + C = 1, which no ellipse
    violates and which rotation leaves alone; MSAC score of Sampson distances; refits of the best few
    with all their inliers.  None, and no inliers, where no ellipse passes the gates on axis ratio,
    size and arc coverage.
    """
    points = np.asarray(points_px, float).reshape(-1, 2)
    nothing = None, np.zeros(len(points), bool)
    if len(points) < 5 or np.ptp(points, 0).max() == 0:
        return nothing
    x, centre, scale = _normalise(points)
    tolerance = settings.ransac_tolerance_px / scale
    theta = _five_point_conics(x, rng.integers(0, len(x), (settings.ransac_hypotheses, 5)))
    theta = theta[_plausible(theta, scale, settings)]
    if not len(theta):
        return nothing
    theta = theta[np.argsort(_msac(theta, x, tolerance))[:REFITTED]]
    for widening in (2.0, 1.5, 1.0):
        inlier = np.abs(_sampson(theta, x)) < widening * tolerance
        theta = np.concatenate([theta, _refine(theta, x, inlier, steps=2)])
    theta = theta[_plausible(theta, scale, settings)]
    for candidate in theta[np.argsort(_msac(theta, x, tolerance))[:REFITTED]]:
        candidate = _polish(candidate, x, tolerance)
        if not _plausible(candidate[None], scale, settings)[0]:
            continue
        ellipse = _to_pixels(ellipse_from_conic(_symmetric(candidate))[0], centre, scale)
        inliers = np.abs(_sampson(candidate[None], x)[0]) < tolerance
        if arc_coverage(ellipse, points[inliers]) >= settings.min_arc_coverage:
            return ellipse, inliers
    return nothing


REFITTED = 10  # hypotheses that get local refits: of 500, about as many as have five inliers at 50 % outliers


def paper_ransac(
    points_px, rng: np.random.Generator, settings: Settings = PAPER
) -> tuple[Ellipse | None, np.ndarray]:
    """The paper's loop as printed: five points, A..E of equation 1 with F = 1 in raw pixels, check of
    the axis ratio, count of inliers, refit of the best hypothesis on its inliers.

    The paper doesn't say how it measures a point's distance; here it is the Sampson distance.
    """
    points = np.asarray(points_px, float).reshape(-1, 2)
    best, inliers = None, np.zeros(len(points), bool)
    if len(points) < 5:
        return best, inliers
    monomials = _monomials(points)[:, :5]
    for _ in range(settings.ransac_hypotheses):
        sample = rng.choice(len(points), 5, replace=False)
        try:
            theta = np.append(np.linalg.solve(monomials[sample], -np.ones(5)), 1.0)
        except np.linalg.LinAlgError:
            continue
        if not _axis_ratio_ok(theta, settings):
            continue
        inlier = np.abs(_sampson(theta[None], points)[0]) < settings.ransac_tolerance_px
        if inlier.sum() > inliers.sum():
            best, inliers = theta, inlier
        if inliers.all():
            break
    if best is None:
        return None, inliers
    theta = np.append(np.linalg.lstsq(monomials[inliers], -np.ones(inliers.sum()))[0], 1.0)
    ellipse, real = ellipse_from_conic(_symmetric(theta))
    return (ellipse, inliers) if real else (None, np.zeros(len(points), bool))


def arc_coverage(ellipse: Ellipse, points_px, sectors: int = 72) -> float:
    """Share of an ellipse's contour, by sectors of equal eccentric anomaly, that has a point."""
    c, s = np.cos(ellipse.angle_rad), np.sin(ellipse.angle_rad)
    local = (np.asarray(points_px, float).reshape(-1, 2) - ellipse.centre_px) @ np.array([[c, -s], [s, c]])
    anomaly = np.arctan2(local[:, 1] / ellipse.semi_axes_px[1], local[:, 0] / ellipse.semi_axes_px[0])
    return len(np.unique(((anomaly / (2 * np.pi)) % 1 * sectors).astype(int) % sectors)) / sectors


def refine_on_mask(ellipse: Ellipse, mask, half_width_px: float, floor: float = 0.1) -> Ellipse:
    """Sub-pixel ellipse along the middle of a soft mask's stroke, started from a nearby ellipse.

    Samples the mask along the ellipse's normals, takes each profile's centroid and refits, twice.
    Profiles without a stroke, cut by the strip's edge, or with a width unlike the others' (a second
    blob, an occluder) don't count; if fewer than half remain, the ellipse is returned as it came.

    Parameters
    ----------
    mask : (H, W), values in [0, 1]
    half_width_px : half the strip's width; about one and a half times the stroke's
    floor : mask values below are background

    Returns
    -------
    Ellipse, whose contour is the stroke's middle along the normals.  The middle of an annulus'
    image is not exactly the image of its centre line: see `annulus_offset_px`.
    """
    mask = np.asarray(mask, np.float32)
    offsets = np.arange(-half_width_px, half_width_px + 0.25, 0.5)
    for _ in range(2):
        points, normals = _contour(ellipse)
        grid = (points[:, None] + offsets[:, None] * normals[:, None]).astype(np.float32)
        profile = cv2.remap(mask, grid, None, cv2.INTER_LINEAR, borderValue=0.0)
        weight = np.maximum(profile - floor, 0)
        mass = weight.sum(1)
        # an annulus' width along the normal is nearly proportional to the support function
        support = np.sum((points - ellipse.centre_px) * normals, 1)
        width = mass / support
        good = (mass > 0) & (np.maximum(weight[:, 0], weight[:, -1]) == 0)
        if good.sum() < 5:
            return ellipse
        typical = np.median(width[good])
        good &= (width > 0.6 * typical) & (width < 1.6 * typical)
        if good.mean() < 0.5:
            return ellipse
        shift = (weight[good] @ offsets / mass[good])[:, None]
        ellipse = _fit_robust(points[good] + shift * normals[good], ellipse)
    return ellipse


def _normalise(points):
    centre = points.mean(0)
    scale = np.sqrt(np.mean((points - centre) ** 2)) or 1.0
    return (points - centre) / scale, centre, scale


def _to_pixels(ellipse: Ellipse, centre, scale) -> Ellipse:
    return Ellipse(ellipse.centre_px * scale + centre, ellipse.semi_axes_px * scale, ellipse.angle_rad)


def _monomials(x):
    u, v = x[..., 0], x[..., 1]
    return np.stack([u * u, u * v, v * v, u, v, np.ones_like(u)], -1)


def _symmetric(theta):
    a, b, c, d, e, f = np.moveaxis(theta, -1, 0)
    return np.stack([np.stack(row, -1) for row in ((a, b / 2, d / 2), (b / 2, c, e / 2), (d / 2, e / 2, f))], -2)


def _direct(x):
    """Halir & Flusser's least squares under 4AC - B^2 = 1, or None."""
    D1, D2 = np.split(_monomials(x), 2, axis=1)
    S1, S2, S3 = D1.T @ D1, D1.T @ D2, D2.T @ D2
    if np.linalg.cond(S3) > 1e12:
        return None
    T = -np.linalg.solve(S3, S2.T)
    M = (S1 + S2 @ T)[::-1] * np.array([[0.5], [-1.0], [0.5]])
    vectors = np.linalg.eig(M)[1].real
    index = np.nonzero(4 * vectors[0] * vectors[2] - vectors[1] ** 2 > 0)[0]
    return np.concatenate([vectors[:, index[0]], T @ vectors[:, index[0]]]) if len(index) else None


def _five_point_conics(x, samples):
    """Conics through five points each with A + C = 1: the other degree of freedom is p = A - C."""
    m = _monomials(x)[samples]
    equations = np.concatenate([(m[..., :1] - m[..., 2:3]) / 2, m[..., [1, 3, 4, 5]]], -1)
    regular = np.abs(np.linalg.det(equations)) > 1e-12
    rhs = -(m[regular][..., :1] + m[regular][..., 2:3]) / 2
    p, b, d, e, f = np.moveaxis(np.linalg.solve(equations[regular], rhs)[..., 0], -1, 0)
    return np.stack([(1 + p) / 2, b, (1 - p) / 2, d, e, f], -1)


def _gradient(theta, x):
    """Value and gradient of conics (K, 6) at points (M, 2): three (K, M) arrays."""
    a, b, c, d, e, _ = np.moveaxis(theta, -1, 0)[..., None]
    u, v = x.T
    return theta @ _monomials(x).T, 2 * a * u + b * v + d, b * u + 2 * c * v + e


def _sampson(theta, x):
    """First-order distance q / |grad q|, (K, 6), (M, 2) -> (K, M)."""
    q, qu, qv = _gradient(theta, x)
    return q / np.maximum(np.hypot(qu, qv), 1e-12)


def _msac(theta, x, tolerance):
    return np.sum(np.minimum(_sampson(theta, x) ** 2, tolerance**2), -1)


def _refine(theta, x, weight, steps: int = 8):
    """Gauss-Newton on weighted squared Sampson distances, batch (K, 6); the direction along theta,
    which changes nothing, is held by the added theta theta'."""
    m = _monomials(x)
    u, v = x.T
    o, i = np.zeros_like(u), np.ones_like(u)
    mu, mv = np.stack([2 * u, v, o, i, o, o], -1), np.stack([o, u, 2 * v, o, i, o], -1)
    for _ in range(steps):
        theta = theta / np.linalg.norm(theta, axis=-1, keepdims=True)
        q, qu, qv = _gradient(theta, x)
        norm = np.maximum(np.hypot(qu, qv), 1e-12)
        r = q / norm
        J = (m - (r / norm)[..., None] * (qu[..., None] * mu + qv[..., None] * mv)) / norm[..., None]
        JW = J * weight[..., None]
        H = np.swapaxes(JW, -1, -2) @ J
        ridge = 1e-9 * np.trace(H, axis1=-2, axis2=-1)[..., None, None] * np.eye(6) + 1e-12 * np.eye(6)
        H = H + ridge + theta[..., :, None] * theta[..., None, :]
        theta = theta - np.linalg.solve(H, np.sum(JW * r[..., None], -2)[..., None])[..., 0]
    return theta


def _polish(theta, x, tolerance):
    """Alternate inliers and fit until they agree."""
    inlier = np.zeros(len(x), bool)
    for _ in range(5):
        now = np.abs(_sampson(theta[None], x)[0]) < tolerance
        if now.sum() < 5 or np.array_equal(now, inlier):
            break
        inlier = now
        theta = _refine(theta[None], x, inlier[None].astype(float), steps=4)[0]
    return theta


def _plausible(theta, scale, settings: Settings):
    ellipse, real = ellipse_from_conic(_symmetric(theta))
    a, b = ellipse.semi_axes_px[..., 0], ellipse.semi_axes_px[..., 1]
    with np.errstate(invalid="ignore"):
        return real & (b >= settings.min_axis_ratio * a) & (a * scale >= settings.min_semi_major_px)


def _axis_ratio_ok(theta, settings: Settings) -> bool:
    ellipse, real = ellipse_from_conic(_symmetric(theta))
    return bool(real) and ellipse.semi_axes_px[1] >= settings.min_axis_ratio * ellipse.semi_axes_px[0]


def _contour(ellipse: Ellipse, spacing_px: float = 1.5):
    """Points about every ``spacing_px`` along the contour, and outward unit normals there."""
    count = max(24, int(np.pi * ellipse.semi_axes_px.sum() / spacing_px))
    points = ellipse.points(count)
    A = conic_from_ellipse(ellipse)
    gradient = points @ A[:2, :2] + A[:2, 2]
    return points, gradient / np.linalg.norm(gradient, axis=1, keepdims=True)


def _fit_robust(points, start: Ellipse) -> Ellipse:
    """Sampson fit with Tukey's weights at 4.7 robust standard deviations, from a nearby ellipse."""
    x, centre, scale = _normalise(points)
    T = np.array([[scale, 0, centre[0]], [0, scale, centre[1]], [0, 0, 1]])
    C = T.T @ conic_from_ellipse(start) @ T
    theta = np.array([C[0, 0], 2 * C[0, 1], C[1, 1], 2 * C[0, 2], 2 * C[1, 2], C[2, 2]])
    for _ in range(4):
        r = np.abs(_sampson(theta[None], x)[0])
        cut = 4.7 * max(1.48 * np.median(r), 1e-9)
        theta = _refine(theta[None], x, np.maximum(1 - (r[None] / cut) ** 2, 0) ** 2, steps=2)[0]
    ellipse, real = ellipse_from_conic(_symmetric(theta))
    return _to_pixels(ellipse, centre, scale) if real else start
