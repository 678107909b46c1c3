"""Conics in the image: ellipses, the images of circles, and the cones of lines of sight through them.

A conic is a symmetric matrix C (..., 3, 3) with x' C x = 0 for homogeneous pixels x = (u, v, 1), or the
vector theta (..., 6) of its coefficients of the monomials (u^2, uv, v^2, u, v, 1).
"""

from __future__ import annotations

import numpy as np

from ..types import Camera, Ellipse, Pose
from .compiled import njit

FLATTEST = 1e-3  # axis ratio: of a needle, 64-bit floats tell no pose
FURTHEST = 300.0  # focal lengths from the optical axis, 89.8 degrees: beyond, the same
SMALLEST_PX = 1e-2  # semi-axis


def monomials(x) -> np.ndarray:
    """(u^2, uv, v^2, u, v, 1) of points (u, v), (..., 2) -> (..., 6)."""
    u, v = x[..., 0], x[..., 1]
    return np.stack([u * u, u * v, v * v, u, v, np.ones_like(u)], -1)


def conic_matrix(theta) -> np.ndarray:
    """Symmetric matrices of conics, (..., 6) -> (..., 3, 3)."""
    halves = np.asarray(theta) * [1, 0.5, 1, 0.5, 0.5, 1]
    return halves[..., [[0, 1, 3], [1, 2, 4], [3, 4, 5]]]


def conic_coefficients(C) -> np.ndarray:
    """Inverse of `conic_matrix`, (..., 3, 3) -> (..., 6)."""
    return C[..., [0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]] * [1, 2, 1, 2, 2, 1]


def cone(C, K) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues l1 >= l2 > 0 > l3 (..., 3) and eigenvectors e1, e2, e3, as columns (..., 3, 3), of the
    cones K' C K of lines of sight through ellipses; e3 points forward."""
    eigenvalues, E = np.linalg.eigh(K.T @ C @ K)  # ascending
    forward = np.where(E[..., 2:, :1] >= 0, 1.0, -1.0)
    return eigenvalues[..., ::-1], np.concatenate([E[..., 2:], E[..., 1:2], E[..., :1] * forward], -1)


def conic_from_ellipse(ellipse: Ellipse) -> np.ndarray:
    """Conic matrices (..., 3, 3) of ellipses, with unit Frobenius norm and positive definite upper block."""
    c, s = np.cos(ellipse.angle_rad), np.sin(ellipse.angle_rad)
    R = np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)
    C = np.empty((*c.shape, 3, 3))
    A = C[..., :2, :2] = (R * ellipse.semi_axes_px[..., None, :] ** -2.0) @ np.swapaxes(R, -1, -2)
    b = C[..., :2, 2] = C[..., 2, :2] = -np.sum(A * ellipse.centre_px[..., None, :], -1)
    C[..., 2, 2] = -np.sum(b * ellipse.centre_px, -1) - 1
    return _unit(C)


def _unit(C) -> np.ndarray:
    """Matrices (..., 3, 3) of unit Frobenius norm."""
    return C / np.sqrt(np.sum(C * C, (-2, -1), keepdims=True))


def ellipse_from_conic(conic) -> tuple[Ellipse, np.ndarray]:
    """Ellipses of conics (..., 3, 3), and which of them are real ellipses (...), the rest being NaN."""
    C = np.array(conic, float, order="C")
    shapes = _shapes(C.reshape(-1, 3, 3)).reshape(*C.shape[:-2], 5)
    return Ellipse(shapes[..., :2], shapes[..., 2:4], shapes[..., 4]), np.isfinite(shapes[..., 0])


@njit(nogil=True, error_model="numpy")
def _shapes(conics):
    """Centres, semi-axes and angles (K, 5) of conics (K, 3, 3).

    Eliminating the linear term gives the centre c = -A^-1 b; then (x-c)' A (x-c) = -f - b'c.
    """
    shapes = np.full((len(conics), 5), np.nan)
    for k in range(len(conics)):
        (a11, a12, b1), (_, a22, b2), (_, _, f) = conics[k, 0], conics[k, 1], conics[k, 2]
        sign = np.sign(a11 + a22)
        a11, a12, a22, b1, b2, f = sign * a11, sign * a12, sign * a22, sign * b1, sign * b2, sign * f
        det = a11 * a22 - a12**2
        u, v = (a12 * b2 - a22 * b1) / det, (a12 * b1 - a11 * b2) / det
        gain = -f - (b1 * u + b2 * v)
        largest = (a11 + a22) / 2 + np.hypot((a11 - a22) / 2, a12)  # eigenvalue of A
        major, minor = np.sqrt(gain * largest / det), np.sqrt(gain / largest)
        if det > 0 and major > 0 and minor > 0 and np.isfinite(u + v + major + minor):
            shapes[k, 0], shapes[k, 1], shapes[k, 2], shapes[k, 3] = u, v, major, minor
            shapes[k, 4] = 0.5 * np.arctan2(-2 * a12, a22 - a11) % np.pi
    return shapes


def circle_conic(T_cam_circle: Pose, radius_m, camera: Camera) -> np.ndarray:
    """Image conic of circles in their frames' xy plane: C = K^-T Q K^-1.

    A line of sight v meets the plane at v (n.p) / (n.v), at a distance r from p where v' Q v = 0 with
    Q = (n.p)^2 1 - (n.p)(n p' + p n') + (p.p - r^2) n n'.
    """
    n, p, K_inv = T_cam_circle.normal, T_cam_circle.position_m, camera.K_inverse
    height = np.sum(n * p, -1)[..., None]
    size = np.sum(p * p, -1) - np.square(radius_m)
    half = n[..., :, None] * (size[..., None] / 2 * n - height * p)[..., None, :]
    Q = height[..., None] ** 2 * np.eye(3) + half + np.swapaxes(half, -1, -2)
    return _unit(K_inv.T @ Q @ K_inv)


def circle_ellipse(T_cam_circle: Pose, radius_m, camera: Camera) -> Ellipse:
    """Undistorted image of circles in space; NaN if it is not an ellipse."""
    return ellipse_from_conic(circle_conic(T_cam_circle, radius_m, camera))[0]


def is_view(ellipse: Ellipse, camera: Camera) -> bool:
    """Whether circles' poses can be computed from these ellipses: finite, not needle-thin, and not too far
    from the optical axis."""
    major, minor = np.moveaxis(ellipse.semi_axes_px, -1, 0)
    reach_px = np.linalg.norm(ellipse.centre_px - camera.K[:2, 2], axis=-1) + major
    good = (minor >= np.maximum(FLATTEST * major, SMALLEST_PX)) & np.isfinite(ellipse.angle_rad)
    return bool(np.all(good & (reach_px <= FURTHEST * min(camera.fx_px, camera.fy_px))))
