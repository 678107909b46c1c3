"""Fits of conics to points: by least squares, through five points, and by least Sampson distance.

Points are (M, 2), conics coefficient vectors (..., 6).  Fits expect coordinates that `normalise` made.
"""

from __future__ import annotations

import numpy as np

from ..types import Ellipse
from .compiled import njit
from .conics import monomials


def normalise(points_px) -> tuple[np.ndarray, np.ndarray, float]:
    """Centre points (M, 2) and scale them to unit spread; return them with the centre and scale removed."""
    centre = points_px.mean(0)
    scale = float(np.sqrt(np.mean((points_px - centre) ** 2)))
    return (points_px - centre) / (scale or 1.0), centre, scale or 1.0


def to_pixels(ellipse: Ellipse, centre_px, scale_px: float) -> Ellipse:
    """Undo `normalise` for ellipses."""
    centre_px = ellipse.centre_px * scale_px + centre_px
    return Ellipse(centre_px, ellipse.semi_axes_px * scale_px, ellipse.angle_rad)


def direct_fit(x) -> np.ndarray | None:
    """Least-squares conic (6,) under 4AC - B^2 = 1 (Halir & Flusser 1998), or None for degenerate points."""
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
    """Conics (K', 6) through the points x[samples], samples (K, 5), leaving out undetermined ones.

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
    theta, x = np.array(theta, float, order="C"), np.array(x.T, float, order="C")
    return _distances(theta.reshape(-1, 6), x).reshape(*theta.shape[:-1], x.shape[1])


def sampson_fit(theta, x, weight, steps: int = 8) -> np.ndarray:
    """Take Gauss-Newton steps on the sum of weight (..., M) times squared Sampson distance, for one conic
    (6,) or several (K, 6).

    A step along theta changes nothing; adding theta theta' to the normal matrix holds it.
    """
    batch, theta, x = theta.shape[:-1], theta.reshape(-1, 6), np.array(x.T, float, order="C")
    for _ in range(steps):
        theta = theta / np.sqrt(np.sum(theta * theta, -1, keepdims=True))
        distance, J = _linearised(theta, x)
        weighted = J * weight[..., None, :]
        normal = weighted @ np.swapaxes(J, 1, 2) + theta[:, :, None] * theta[:, None, :]
        ridge = 1e-9 * (1 + np.trace(normal, axis1=1, axis2=2))[:, None, None]
        step = np.linalg.solve(normal + ridge * np.eye(6), weighted @ distance[..., None])
        theta = theta - step[..., 0]
    return theta.reshape(*batch, 6)


@njit(nogil=True, error_model="numpy")
def _distances(theta, x):
    """Sampson distances (K, M) of points (2, M) to conics (K, 6)."""
    distance = np.empty((len(theta), x.shape[1]))
    for k in range(len(theta)):
        for i in range(x.shape[1]):
            q, _, _, g = _value_and_slope(theta[k], x[0, i], x[1, i])
            distance[k, i] = q / g
    return distance


@njit(nogil=True, error_model="numpy")
def _value_and_slope(theta, u, v):
    """A conic's q = theta' monomials at a point, its derivatives along u and v, and |grad q|, kept from 0."""
    a, b, c, d, e, f = theta
    q_u, q_v = 2 * a * u + b * v + d, b * u + 2 * c * v + e
    q = (a * u + b * v + d) * u + (c * v + e) * v + f
    return q, q_u, q_v, np.sqrt(max(q_u * q_u + q_v * q_v, 1e-24))


@njit(nogil=True, error_model="numpy")
def _linearised(theta, x):
    """Sampson distances (K, M), and their derivatives (K, 6, M) by the conics."""
    distance, J = np.empty((len(theta), x.shape[1])), np.empty((len(theta), 6, x.shape[1]))
    for k in range(len(theta)):
        for i in range(x.shape[1]):
            u, v = x[0, i], x[1, i]
            q, q_u, q_v, g = _value_and_slope(theta[k], u, v)
            s, t = q * q_u / g**2, q * q_v / g**2
            distance[k, i] = q / g
            J[k, 0, i] = (u * u - 2 * s * u) / g
            J[k, 1, i] = (u * v - s * v - t * u) / g
            J[k, 2, i] = (v * v - 2 * t * v) / g
            J[k, 3, i], J[k, 4, i], J[k, 5, i] = (u - s) / g, (v - t) / g, 1 / g
    return distance, J
