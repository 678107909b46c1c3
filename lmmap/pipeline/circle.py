"""A circle of known radius, seen as an ellipse, has two poses.

`poses` solves that exactly, `paper_poses` as the paper prints it.  Both take *undistorted* ellipses
(pixels of the same camera without its distortion).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..geometry.conics import FLATTEST, FURTHEST, cone, conic_from_ellipse, is_view
from ..types import Camera, Ellipse, Pose, checked, frozen_numbers


@checked
def poses(ellipse: Ellipse, camera: Camera, radius_m: float) -> Pose:
    """Both poses ``T_cam_port`` of circles that project to the ellipses, batch (..., 2).

    The cone Q = K' C K through the conic C, with eigenvalues l1 >= l2 > 0 > l3 and eigenvectors
    e1, e2, e3, cuts in a circle on two families of planes (Kanatani & Liu 1993):

        n = +-sqrt((l1 - l2) / (l1 - l3)) e1 + sqrt((l2 - l3) / (l1 - l3)) e3
        p = radius / sqrt(-l1 l3) (l3 n1 e1 + l1 n3 e3)

    Normals point toward the camera (n . p < 0); yaw is arbitrary but deterministic (see
    `_frame`).  In the first pose the end of the minor axis that is 90 deg from the major axis'
    direction leans toward the camera, in the second the other one; fronto-parallel they coincide.

    Raises
    ------
    ValueError
        If the radius is not positive, or an ellipse is not the view of a circle (`is_view`).
    """
    _check(ellipse, camera, radius_m)
    eigenvalues, E = cone(conic_from_ellipse(ellipse), camera.K)
    l1, l2, l3 = np.moveaxis(eigenvalues, -1, 0)
    e1, e3 = E[..., :, 0], E[..., :, 2]
    e1 = e1 * _sign(np.sum(e1[..., :2] * _minor_direction(ellipse), -1))

    n1 = np.stack([np.sqrt((l1 - l2) / (l1 - l3))] * 2, -1) * [1, -1]
    n3 = np.sqrt((l2 - l3) / (l1 - l3))[..., None]
    l1, l3 = l1[..., None], l3[..., None]
    e1, e3 = e1[..., None, :], e3[..., None, :]
    n = n1[..., None] * e1 + n3[..., None] * e3
    p = (l3 * n1)[..., None] * e1 + (l1 * n3)[..., None] * e3
    p = p * (radius_m / np.sqrt(-l1 * l3))[..., None]
    return Pose(_frame(-n), p)


@checked
def paper_poses(ellipse: Ellipse, camera: Camera, radius_m: float) -> Pose:
    """Both poses by the paper's formulas, batch (..., 2), ordered as in `poses`.

    Position from the bearings of the major axis' ends; normals as the cross product of the major
    axis with the minor axis in space, whose ends are the nearer solutions of
    |d v - p|^2 = radius^2.  If the line of sight misses that sphere (negative discriminant), the
    discriminant is taken as zero, which gives the point of the line nearest to p.

    Raises
    ------
    ValueError
        As `poses`.
    """
    _check(ellipse, camera, radius_m)
    major, minor = axis_bearings(ellipse, camera)
    p = printed_centre(major, radius_m)[..., None, :]
    nearer, _ = points_on_sphere(minor, p, radius_m)
    n = np.cross((major[..., 1, :] - major[..., 0, :])[..., None, :], nearer - p)
    n = n / np.linalg.norm(n, axis=-1, keepdims=True)
    return Pose(_frame(-n * _sign(np.sum(n * p, -1))), np.broadcast_to(p, n.shape))


@checked
def candidates(ellipse: Ellipse, camera: Camera, radius_m: float) -> Pose:
    """Poses (4,) that a ring's ellipse allows, up to yaw: two exact, two by the paper's formula; raises
    ValueError as `poses`."""
    return Pose.stack([f(ellipse, camera, radius_m) for f in (poses, paper_poses)])


@checked
def axis_bearings(ellipse: Ellipse, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Unit bearings (..., 2, 3) of both ends of the major and of the minor axis of undistorted ellipses."""
    minor = _minor_direction(ellipse)
    directions = np.stack([np.stack([minor[..., 1], -minor[..., 0]], -1), minor], -2)
    half_px = ellipse.semi_axes_px[..., None] * directions  # (..., axis, 2)
    ends_px = ellipse.centre_px[..., None, None, :] + np.stack([half_px, -half_px], -2)
    v = _unit_bearing(ends_px, camera)
    return v[..., 0, :, :], v[..., 1, :, :]


@checked
def printed_centre(major: ArrayLike, radius_m: float) -> np.ndarray:
    """The paper's position (..., 3) of the ring, from the bearings (..., 2, 3) of the major axis' ends."""
    major = frozen_numbers("major", major, 2, 3)
    along = np.linalg.norm(major[..., 1, :] - major[..., 0, :], axis=-1, keepdims=True)
    return radius_m * major.sum(-2) / along


@checked
def points_on_sphere(v: ArrayLike, p: ArrayLike, radius_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (..., 3) at which lines of sight v (..., 3) enter and leave the sphere of a radius around p
    (..., 3); if a line misses it, the point of the line nearest to p."""
    v, p = frozen_numbers("v", v, 3), frozen_numbers("p", p, 3)
    along = np.sum(v * p, -1)
    discriminant = along**2 - np.sum(p * p, -1) + radius_m**2
    half_chord_m = np.sqrt(np.maximum(discriminant, 0))
    nearer, further = ((along + sign * half_chord_m)[..., None] * v for sign in (-1, 1))
    return nearer, further


def _frame(n) -> np.ndarray:
    """Rotations with third column n, (..., 3) -> (..., 3, 3): the camera turned half about x, then
    by the least rotation that brings its z axis to n.  Smooth for every normal but (0, 0, 1), which
    looks away from the camera."""
    x, y, z = np.moveaxis(n, -1, 0)
    k = 1 / (1 - z)
    columns = (1 - k * x * x, -k * x * y, x), (k * x * y, k * y * y - 1, -y), (x, y, z)
    return np.moveaxis(np.array(columns), (0, 1), (-1, -2))


def _minor_direction(ellipse: Ellipse) -> np.ndarray:
    return np.stack([-np.sin(ellipse.angle_rad), np.cos(ellipse.angle_rad)], -1)


def _unit_bearing(points_px, camera: Camera) -> np.ndarray:
    xy = (points_px - [camera.cx_px, camera.cy_px]) / [camera.fx_px, camera.fy_px]
    v = np.concatenate([xy, np.ones_like(xy[..., :1])], -1)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def _sign(a) -> np.ndarray:
    """Sign with a trailing axis, +1 for zero."""
    return np.where(a >= 0, 1.0, -1.0)[..., None]


def _check(ellipse: Ellipse, camera: Camera, radius_m: float) -> None:
    if not 0 < radius_m < np.inf:
        raise ValueError(f"radius_m: expected a positive number, got {radius_m}")
    if not is_view(ellipse, camera):
        raise ValueError(
            f"ellipse: expected the view of a circle, within {FURTHEST:g} focal lengths and no flatter than "
            f"{FLATTEST:g}, got {ellipse!r:.300}"
        )
