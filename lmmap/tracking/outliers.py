"""Which estimates to believe: by their neighbours (the paper's outlier filter), or by their covariance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..geometry.rotations import rotation_between_rad
from ..settings import OURS, PAPER, PaperSettings, Settings
from ..types import Estimate


def outlier_filter(
    estimates: Sequence[Estimate], yaw_period_rad: float, settings: PaperSettings = PAPER
) -> np.ndarray:
    """Which estimates the paper's filter keeps, shape (N,) bool.

    An estimate is kept if it ends a run of three consecutive ones (``outlier_poses``) whose
    orientations differ by no more than 15 deg (``outlier_angle_rad``), modulo the port's symmetry,
    each from the one before.  A frame without a pose breaks the run: the paper doesn't say, and this
    is the stricter reading.
    """
    has_pose = np.array([e.T_cam_port is not None for e in estimates], bool)
    rotation = np.array([np.eye(3) if e.T_cam_port is None else e.T_cam_port.rotation for e in estimates])
    keep = has_pose.copy()
    if len(estimates) > 1:
        angle = rotation_between_rad(rotation[:-1], rotation[1:], yaw_period_rad)
        close = has_pose[:-1] & has_pose[1:] & (angle <= settings.outlier_angle_rad)
    else:
        close = np.zeros(0, bool)
    for back in range(settings.outlier_poses - 1):
        keep[: back + 1] = False
        keep[back + 1 :] &= close[: len(close) - back]
    return keep


def sigmas(estimate: Estimate) -> tuple[float, float]:
    """Standard deviations of the position (m) and of the normal (rad), each along its worst direction."""
    C, n = estimate.covariance, estimate.T_cam_port.normal
    across = np.eye(3) - np.outer(n, n)
    worst = [np.linalg.eigvalsh(block)[-1] for block in (C[:3, :3], across @ C[3:, 3:] @ across)]
    return tuple(float(np.sqrt(max(w, 0))) for w in worst)


def is_certain(estimates: Sequence[Estimate], settings: Settings = OURS) -> np.ndarray:
    """Which estimates promise to be right, shape (N,) bool: ``certain_sigmas`` times their `sigmas` are
    within the errors ``right_position_m`` and ``right_normal_rad``."""
    sure, limits = settings.certain_sigmas, (settings.right_position_m, settings.right_normal_rad)
    return np.array([e.T_cam_port is not None and np.all(sure * np.array(sigmas(e)) <= limits)
                     for e in estimates], bool)  # fmt: skip
