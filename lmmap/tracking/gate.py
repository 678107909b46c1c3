"""Whether a measured pose fits a track.

A pose (p_m, R_m) with covariance S is compared with the track's pose (p, R) of covariance P by

    y = (p_m - p, log(R_m Rz(k yaw_period) R^T)),    k with the smallest rotation,

and keeps the gate while y' (P + S)^-1 y is no larger than it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..geometry.rotations import rotation_angle_rad, single_rotation_vector
from ..types import Estimate, Pose
from .motion_model import MotionState


class Match(NamedTuple):
    """Innovation (6,) and covariance (6, 6) of a measured pose, and whether it is an estimate's rival."""

    innovation: np.ndarray
    covariance: np.ndarray
    is_rival: bool


def match(track: MotionState, e: Estimate, turns: np.ndarray, gate: float) -> Match | None:
    """How an estimate keeps the gate, or its rival where only that does; None where neither does.

    Parameters
    ----------
    turns : (K, 3, 3)
        Rotations of the port about its normal that cannot be told apart (`rotations.equal_turns`).
    gate
        Largest squared Mahalanobis distance.
    """
    choices = [(e.T_cam_port, e.covariance, False)]
    if e.rival is not None:
        S = rotate_covariance(e.covariance, e.T_cam_port.normal, e.rival.normal)
        choices.append((e.rival, S, True))
    for T, S, is_rival in choices:
        y = innovation(track.T_cam_port, T, turns)
        if y @ np.linalg.solve(track.pose_covariance + S, y) <= gate:
            return Match(y, S, is_rival)
    return None


def innovation(T: Pose, measured: Pose, turns: np.ndarray) -> np.ndarray:
    """Position difference (m) and smallest rotation vector from a pose to a measured one, (6,)."""
    turned = measured.rotation @ turns @ T.rotation.T
    nearest = turned[np.argmin(rotation_angle_rad(turned))]
    return np.concatenate([measured.position_m - T.position_m, single_rotation_vector(nearest)])


def rotate_covariance(covariance, normal, rival) -> np.ndarray:
    """A pose's covariance for its rival: rotations are turned as the normal is, by the shortest way."""
    axis, cosine = np.cross(normal, rival), float(normal @ rival)
    cross = np.cross(np.eye(3), axis)  # [axis]x
    turn = np.eye(6)
    turn[3:, 3:] += cross + cross @ cross / max(1 + cosine, 1e-9)
    return turn @ covariance @ turn.T
