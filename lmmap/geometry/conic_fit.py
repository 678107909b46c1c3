"""Fits of conics to points: by least squares, through five points, and of least Sampson distance.

Points are (M, 2), conics coefficient vectors (..., 6).  Fits expect coordinates that `normalise` made.
"""

from __future__ import annotations

import numpy as np

from ..types import Ellipse
from .conics import monomials


def normalise(points_px) -> tuple[np.ndarray, np.ndarray, float]:
    """Points centred and scaled to unit spread, with the centre and scale that were taken out."""
    centre = points_px.mean(0)
    scale = float(np.sqrt(np.mean((points_px - centre) ** 2)))
    return (points_px - centre) / (scale or 1.0), centre, scale or 1.0


def to_pixels(ellipse: Ellipse, centre_px, scale_px: float) -> Ellipse:
    """Undo `normalise` for ellipses."""
    centre_px = ellipse.centre_px * scale_px + centre_px
    return Ellipse(centre_px, ellipse.semi_axes_px * scale_px, ellipse.angle_rad)


def direct_fit(x) -> np.ndarray | None:
    """Least squares under 4AC - B^2 = 1 (Halir & Flusser 1998), or None for degenerate points."""
    D1, D2 = np.split(monomials(x), 2, axis=1)
    S1, S2, S3 = D1.T @ D1, D1.T @ D2, D2.T @ D2
    if np.linalg.cond(S3) > 1e12:
        return None
    T = -np.linalg.solve(S3, S2.T)
    M = (S1 + S2 @ T)[::-1] * np.array([[0.5], [-1.0], [0.5]])
    vectors = np.linalg.eig(M)[1].real
    index = np.nonzero(4 * vectors[0] * vectors[2] - vectors[1] ** 2 > 0)[0]
    return np.concatenate([vectors[:, index[0]], T @ vectors[:, index[0]]]) if len(index) else None


def five_point_conics(x, samples) -> np.ndarray:
    """Conics through the points x[samples], samples (K, 5), leaving out undetermined ones.

    A + C = 1 fixes the scale: no ellipse violates it and no rotation changes it.  The unknowns are
    p = A - C, B, D, E, F.
    """
    a, b, c, d, e, f = np.moveaxis(monomials(x)[samples], -1, 0)
    equations = np.stack([(a - c) / 2, b, d, e, f], -1)
    regular = np.abs(np.linalg.det(equations)) > 1e-12
    right = -(a + c)[regular][..., None] / 2
    p, b, d, e, f = np.moveaxis(np.linalg.solve(equations[regular], right)[..., 0], -1, 0)
    return np.stack([(1 + p) / 2, b, (1 - p) / 2, d, e, f], -1)


def sampson_distance(theta, x) -> np.ndarray:
    """First-order distance q / |grad q| of points to conics, (..., 6), (M, 2) -> (..., M)."""
    return theta @ monomials(x).T / _length(*_gradient(theta, x))


def sampson_fit(theta, x, weight, steps: int = 8) -> np.ndarray:
    """Gauss-Newton steps on the sum of weight (..., M) times squared Sampson distance.

    A step along theta changes nothing; adding theta theta' to the normal matrix holds it.
    """
    (u, v), m = x.T, monomials(x).T  # (6, M)
    zeros, ones = np.zeros(len(x)), np.ones(len(x))
    m_u = np.stack([2 * u, v, zeros, ones, zeros, zeros])
    m_v = np.stack([zeros, u, 2 * v, zeros, ones, zeros])
    for _ in range(steps):
        theta = theta / np.linalg.norm(theta, axis=-1, keepdims=True)
        q, qu, qv = (part[..., None, :] for part in (theta @ m, *_gradient(theta, x)))
        g = _length(qu, qv)
        distance = q / g
        J = (m - distance * (qu * m_u + qv * m_v) / g) / g
        weighted = J * weight[..., None, :]
        normal = weighted @ np.swapaxes(J, -1, -2) + theta[..., :, None] * theta[..., None, :]
        ridge = 1e-9 * (1 + np.trace(normal, axis1=-2, axis2=-1))[..., None, None]
        step = np.linalg.solve(normal + ridge * np.eye(6), weighted @ np.swapaxes(distance, -1, -2))
        theta = theta - step[..., 0]
    return theta


def _length(u, v):
    """Of (u, v), kept from zero; `np.hypot` guards against overflow and takes several times longer."""
    return np.sqrt(np.maximum(u * u + v * v, 1e-24))


def _gradient(theta, x):
    """Of q = theta' monomials along u and v, (..., M) each."""
    a, b, c, d, e, _ = np.moveaxis(np.asarray(theta)[..., None], -2, 0)
    u, v = x.T
    return 2 * a * u + b * v + d, b * u + 2 * c * v + e
