"""Errors of poses against the true ones, and the differences between them."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from ..geometry.rotations import angle_between_rad, equal_turns, rotation_angle_rad, rotation_between_rad
from ..types import AnyRecording, Estimate, Pose


def true_poses(recording: AnyRecording, estimates: list[Estimate]) -> tuple[list[Estimate], Pose]:
    """The estimates whose times the truth covers, and the true poses (N,) at those times."""
    assert recording.truth is not None
    times_us = np.array([e.t_us for e in estimates], np.int64)
    covered = recording.truth.covers(times_us)
    known = [e for e, inside in zip(estimates, covered, strict=True) if inside]
    return known, recording.truth.at(times_us[covered])


def position_error_m(estimate: Pose, truth: Pose) -> np.ndarray:
    """Distance between positions (m), shape (...)."""
    return np.linalg.norm(estimate.position_m - truth.position_m, axis=-1)


def normal_error_rad(estimate: Pose, truth: Pose) -> np.ndarray:
    """Angle between normals (rad), shape (...)."""
    return angle_between_rad(estimate.normal, truth.normal)


def rotation_error_rad(estimate: Pose, truth: Pose, yaw_period_rad: float) -> np.ndarray:
    """Smallest angle between orientations (rad), modulo the port's symmetry, shape (...)."""
    return rotation_between_rad(estimate.rotation, truth.rotation, yaw_period_rad)


def pose_difference(estimate: Pose, truth: Pose, yaw_period_rad: float) -> np.ndarray:
    """Differences (N, 6) from estimates to true poses, modulo the port's symmetry: position (m), and the
    rotation vector (rad), along the camera's axes, that left-multiplies the estimate's rotation."""
    back = np.swapaxes(estimate.rotation, -1, -2)
    left = truth.rotation[:, None] @ equal_turns(yaw_period_rad) @ back[:, None]
    nearest = np.argmin(rotation_angle_rad(left), 1)
    rotation = Rotation.from_matrix(left[np.arange(len(left)), nearest]).as_rotvec()
    return np.concatenate([truth.position_m - estimate.position_m, rotation.reshape(-1, 3)], -1)
