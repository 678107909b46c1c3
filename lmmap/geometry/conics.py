"""Conics in the image: ellipses, the images of circles, and the cones of lines of sight through them.

A conic is a symmetric matrix C (..., 3, 3) with x' C x = 0 for homogeneous pixels x = (u, v, 1), or the
vector theta (..., 6) of its coefficients of the monomials (u^2, uv, v^2, u, v, 1).
"""

from __future__ import annotations

import numpy as np

from ..types import Camera, Ellipse, Pose

FLATTEST = 1e-3  # axis ratio: of a needle, 64-bit floats tell no pose
FURTHEST = 300.0  # focal lengths from the optical axis, 89.8 degrees: beyond, the same
SMALLEST_PX = 1e-2  # semi-axis


def monomials(x) -> np.ndarray:
    """(..., 2) -> (..., 6)."""
    u, v = x[..., 0], x[..., 1]
    return np.stack([u * u, u * v, v * v, u, v, np.ones_like(u)], -1)


def conic_matrix(theta) -> np.ndarray:
    """Symmetric matrices of conics, (..., 6) -> (..., 3, 3)."""
    a, b, c, d, e, f = np.moveaxis(theta, -1, 0)
    rows = (a, b / 2, d / 2), (b / 2, c, e / 2), (d / 2, e / 2, f)
    return np.stack([np.stack(row, -1) for row in rows], -2)


def conic_coefficients(C) -> np.ndarray:
    """Inverse of `conic_matrix`."""
    return np.stack([C[..., 0, 0], 2 * C[..., 0, 1], C[..., 1, 1],
                     2 * C[..., 0, 2], 2 * C[..., 1, 2], C[..., 2, 2]], -1)  # fmt: skip


def cone(C, K) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues l1 >= l2 > 0 > l3 (..., 3) and eigenvectors e1, e2, e3, as columns (..., 3, 3), of the
    cones K' C K of lines of sight through ellipses; e3 points forward."""
    eigenvalues, E = np.linalg.eigh(K.T @ C @ K)  # ascending
    forward = np.where(E[..., 2:, :1] >= 0, 1.0, -1.0)
    return eigenvalues[..., ::-1], np.concatenate([E[..., 2:], E[..., 1:2], E[..., :1] * forward], -1)


def conic_from_ellipse(ellipse: Ellipse) -> np.ndarray:
    """Conic matrices of ellipses, with unit Frobenius norm and positive definite upper block."""
    c, s = np.cos(ellipse.angle_rad), np.sin(ellipse.angle_rad)
    R = np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)
    A = np.einsum("...ij,...j,...kj->...ik", R, ellipse.semi_axes_px**-2.0, R)
    b = -np.einsum("...ij,...j->...i", A, ellipse.centre_px)
    f = -np.einsum("...i,...i->...", b, ellipse.centre_px) - 1
    return _conic(A, b, f)


def _conic(A, b, f) -> np.ndarray:
    top = np.concatenate([A, b[..., :, None]], -1)
    bottom = np.concatenate([b, f[..., None]], -1)[..., None, :]
    C = np.concatenate([top, bottom], -2)
    return C / np.linalg.norm(C, axis=(-2, -1), keepdims=True)


def ellipse_from_conic(conic) -> tuple[Ellipse, np.ndarray]:
    """Ellipses of conics (..., 3, 3), and which of them are real ellipses (...), the rest being NaN.

    Eliminating the linear term gives the centre c = -A^-1 b; then (x-c)' A (x-c) = -f - b'c.
    """
    C = np.asarray(conic, float)
    with np.errstate(all="ignore"):
        C = C * np.sign(C[..., 0, 0] + C[..., 1, 1])[..., None, None]
        A, b, f = C[..., :2, :2], C[..., :2, 2], C[..., 2, 2]
        a11, a12, a22 = A[..., 0, 0], A[..., 0, 1], A[..., 1, 1]
        det = a11 * a22 - a12**2
        centre = np.stack([a12 * b[..., 1] - a22 * b[..., 0], a12 * b[..., 0] - a11 * b[..., 1]], -1)
        centre = centre / det[..., None]
        gain = -f - np.sum(b * centre, -1)
        mean, half = (a11 + a22) / 2, np.hypot((a11 - a22) / 2, a12)
        axes = np.sqrt(np.stack([gain * (mean + half) / det, gain / (mean + half)], -1))
        angle = 0.5 * np.arctan2(-2 * a12, a22 - a11)
    real = (det > 0) & np.all(np.isfinite(axes) & (axes > 0), -1) & np.all(np.isfinite(centre), -1)
    angle = np.where(real, angle, np.nan)
    axes = np.where(real[..., None], axes, np.nan)
    centre = np.where(real[..., None], centre, np.nan)
    return Ellipse(centre, axes, angle % np.pi), real


def circle_conic(T_cam_circle: Pose, radius_m, camera: Camera) -> np.ndarray:
    """Image conic of circles in their frames' xy plane: C = H^-T diag(1, 1, -r^2) H^-1."""
    R, p = T_cam_circle.rotation, T_cam_circle.position_m
    H = camera.K @ np.concatenate([R[..., :, :2], p[..., :, None]], -1)
    H_inv = np.linalg.inv(H)
    r2 = np.broadcast_to(np.asarray(radius_m, float) ** 2, p.shape[:-1])
    D = np.zeros((*r2.shape, 3, 3))
    D[..., 0, 0] = D[..., 1, 1] = 1
    D[..., 2, 2] = -r2
    C = np.swapaxes(H_inv, -1, -2) @ D @ H_inv
    return C / np.linalg.norm(C, axis=(-2, -1), keepdims=True)


def circle_ellipse(T_cam_circle: Pose, radius_m, camera: Camera) -> Ellipse:
    """Undistorted image of circles in space; NaN where it is no ellipse."""
    return ellipse_from_conic(circle_conic(T_cam_circle, radius_m, camera))[0]


def is_view(ellipse: Ellipse, camera: Camera) -> bool:
    """Whether ellipses are such that the poses of circles follow from them: finite, no needles, before the
    camera."""
    major, minor = np.moveaxis(ellipse.semi_axes_px, -1, 0)
    reach_px = np.linalg.norm(ellipse.centre_px - camera.K[:2, 2], axis=-1) + major
    good = (minor >= np.maximum(FLATTEST * major, SMALLEST_PX)) & np.isfinite(ellipse.angle_rad)
    return bool(np.all(good & (reach_px <= FURTHEST * min(camera.fx_px, camera.fy_px))))
