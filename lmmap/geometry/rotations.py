"""Rotations and angles between orientations, also for an object that looks the same at several yaws."""

from __future__ import annotations

import math

import numpy as np

from ..types import Pose


def rotation_z(angle_rad) -> np.ndarray:
    """Rotations about z, (...) -> (..., 3, 3)."""
    R = np.zeros((*np.shape(angle_rad), 3, 3))
    R[..., 0, 0] = R[..., 1, 1] = np.cos(angle_rad)
    R[..., 1, 0] = np.sin(angle_rad)
    R[..., 0, 1] = -R[..., 1, 0]
    R[..., 2, 2] = 1
    return R


def rotation_angle_rad(rotation) -> np.ndarray:
    """Angles of rotation matrices in [0, pi], (..., 3, 3) -> (...); accurate near zero too."""
    R = np.asarray(rotation)
    skew = (R - np.swapaxes(R, -1, -2))[..., [2, 0, 1], [1, 2, 0]]
    return np.arctan2(np.linalg.norm(skew, axis=-1), np.trace(R, axis1=-2, axis2=-1) - 1)


def single_rotation_matrix(vector) -> np.ndarray:
    """The rotation matrix (3, 3) of one rotation vector (3,), by Rodrigues' formula.

    `single_rotation_vector` is the inverse.  Both take a few microseconds, for filters that rotate a thousand
    times a second.
    """
    x, y, z = (float(v) for v in vector)
    square = x * x + y * y + z * z
    angle = math.sqrt(square)
    s = math.sin(angle) / angle if angle > 1e-6 else 1 - square / 6
    c = (1 - math.cos(angle)) / square if angle > 1e-4 else 0.5 - square / 24
    return np.array([[1 - c * (y * y + z * z), c * x * y - s * z, c * x * z + s * y],
                     [c * x * y + s * z, 1 - c * (x * x + z * z), c * y * z - s * x],
                     [c * x * z - s * y, c * y * z + s * x, 1 - c * (x * x + y * y)]])  # fmt: skip


def single_rotation_vector(R) -> np.ndarray:
    """The rotation vector (3,) of one matrix (3, 3); zero at exactly half a turn."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = R.tolist()
    x, y, z = (zy - yz) / 2, (xz - zx) / 2, (yx - xy) / 2
    sine = math.sqrt(x * x + y * y + z * z)
    scale = math.atan2(sine, (xx + yy + zz - 1) / 2) / sine if sine > 1e-9 else 1.0
    return np.array([scale * x, scale * y, scale * z])


def angle_between_rad(a, b) -> np.ndarray:
    """Angles between directions (..., 3) x 2 -> (...), in [0, pi]; accurate near zero too."""
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(np.asarray(a) * b, -1))


def move(T: Pose, step) -> Pose:
    """The pose one step (6,) away: position (m), then a rotation vector (rad) that multiplies on the left."""
    return Pose(single_rotation_matrix(step[3:]) @ T.rotation, T.position_m + step[:3])


def step_between(T: Pose, other: Pose, turns: np.ndarray | None = None) -> np.ndarray:
    """The step (6,) by which `move` takes one pose to another, the smallest over the ``turns`` (K, 3, 3) that
    leave the object unchanged (`equal_turns`)."""
    if turns is None:
        turned = other.rotation @ T.rotation.T
    else:
        choices = other.rotation @ turns @ T.rotation.T
        turned = choices[np.argmin(rotation_angle_rad(choices))]
    return np.concatenate([other.position_m - T.position_m, single_rotation_vector(turned)])


def equal_turns(yaw_period_rad: float) -> np.ndarray:
    """Rotations (K, 3, 3) about z that leave an object with the period ``yaw_period_rad`` unchanged."""
    return rotation_z(np.arange(round(2 * np.pi / yaw_period_rad)) * yaw_period_rad)


def rotation_between_rad(R_a, R_b, yaw_period_rad: float) -> np.ndarray:
    """Smallest angle between orientations of an object that repeats every ``yaw_period_rad`` about its
    own z axis, (..., 3, 3) x 2 -> (...)."""
    relative = np.swapaxes(R_a, -1, -2) @ R_b
    return np.min(rotation_angle_rad(relative[..., None, :, :] @ equal_turns(yaw_period_rad)), -1)
