"""The paper's outlier filter: an estimate is kept if the preceding ones agree with it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..geometry.rotations import rotation_between_rad
from ..settings import PAPER, PaperSettings
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
    rotation = np.reshape(
        [np.eye(3) if (T := e.T_cam_port) is None else T.rotation for e in estimates], (-1, 3, 3)
    )
    keep = has_pose.copy()
    angle = rotation_between_rad(rotation[:-1], rotation[1:], yaw_period_rad)
    close = has_pose[:-1] & has_pose[1:] & (angle <= settings.outlier_angle_rad)
    for back in range(settings.outlier_poses - 1):
        keep[: back + 1] = False
        keep[back + 1 :] &= close[: len(close) - back]
    return keep
