"""Errors of poses against true ones, and the difference between them."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from ..geometry.rotations import angle_between_rad, equal_turns, rotation_angle_rad, rotation_between_rad
from ..types import AnyRecording, Estimate, Pose


def true_poses(recording: AnyRecording, estimates: list[Estimate]) -> tuple[list[Estimate], Pose]:
    """The estimates whose time the truth covers, and the true poses then."""
    assert recording.truth is not None
    times_us = np.array([e.t_us for e in estimates], np.int64)
    covered = recording.truth.covers(times_us)
    known = [e for e, inside in zip(estimates, covered, strict=True) if inside]
    return known, recording.truth.at(times_us[covered])


def position_error_m(estimate: Pose, truth: Pose) -> np.ndarray:
    """Distance between positions, shape (...)."""
    return np.linalg.norm(estimate.position_m - truth.position_m, axis=-1)


def normal_error_rad(estimate: Pose, truth: Pose) -> np.ndarray:
    """Angle between normals, shape (...)."""
    return angle_between_rad(estimate.normal, truth.normal)


def rotation_error_rad(estimate: Pose, truth: Pose, yaw_period_rad: float) -> np.ndarray:
    """Angle between orientations, the smallest over the port's symmetry, shape (...)."""
    return rotation_between_rad(estimate.rotation, truth.rotation, yaw_period_rad)


def pose_difference(estimate: Pose, truth: Pose, yaw_period_rad: float) -> np.ndarray:
    """From estimates to true poses, modulo the port's symmetry, (N, 6): position in m, and the rotation in
    rad that is to be put on the left of the estimate's, along the camera's axes."""
    back = np.swapaxes(estimate.rotation, -1, -2)
    left = truth.rotation[:, None] @ equal_turns(yaw_period_rad) @ back[:, None]
    nearest = np.argmin(rotation_angle_rad(left), 1)
    rotation = Rotation.from_matrix(left[np.arange(len(left)), nearest]).as_rotvec()
    return np.concatenate([truth.position_m - estimate.position_m, rotation.reshape(-1, 3)], -1)
