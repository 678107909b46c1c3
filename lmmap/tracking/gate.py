"""Whether a measured pose fits a track.

A pose (p_m, R_m) with covariance S is compared with the track's pose (p, R) of covariance P by

    y = (p_m - p, log(R_m Rz(k yaw_period) R^T)),    k with the smallest rotation,

and passes the gate if y' (P + S)^-1 y is no larger than the gate.
"""

from __future__ import annotations

from typing import NamedTuple, cast

import numpy as np

from ..geometry.rotations import step_between
from ..types import Estimate, check_time
from .motion_model import MotionState

ROUNDED = 1e-6  # of a correlation: what a table's digits may take from a covariance's symmetry


class Match(NamedTuple):
    """Innovation (6,) and covariance (6, 6) of a measured pose, and whether it is an estimate's rival."""

    innovation: np.ndarray
    covariance: np.ndarray
    is_rival: bool


def match(track: MotionState, e: Estimate, turns: np.ndarray, gate: float) -> Match | None:
    """How an estimate, or else its rival, matches the track; None if neither passes the gate.

    Parameters
    ----------
    turns : (K, 3, 3)
        Rotations about the port's normal that leave it unchanged (`rotations.equal_turns`).
    gate
        Largest squared Mahalanobis distance.
    """
    assert e.T_cam_port is not None and e.covariance is not None
    choices = [(e.T_cam_port, e.covariance, False)]
    if e.rival is not None:
        S = rotate_covariance(e.covariance, e.T_cam_port.normal, e.rival.normal)
        choices.append((e.rival, S, True))
    for T, S, is_rival in choices:
        y = step_between(track.T_cam_port, T, turns)
        if y @ np.linalg.solve(track.pose_covariance + S, y) <= gate:
            return Match(y, S, is_rival)
    return None


def rotate_covariance(covariance, normal, rival) -> np.ndarray:
    """Convert a pose's covariance (6, 6) to its rival: the rotation's part turns with the normal, by the
    shortest rotation."""
    axis, cosine = np.cross(normal, rival), float(normal @ rival)
    cross = np.cross(np.eye(3), axis)  # [axis]x
    turn = np.eye(6)
    turn[3:, 3:] += cross + cross @ cross / max(1 + cosine, 1e-9)
    return turn @ covariance @ turn.T


def check_pair(pair) -> tuple[str, Estimate]:
    """Return a camera's name and its estimate; raises ValueError for anything else, or for a pose without a
    valid covariance or confidence."""
    if not (isinstance(pair, tuple | list) and len(pair) == 2 and isinstance(pair[1], Estimate)):
        raise ValueError(f"timed: expected pairs of a camera's name and an Estimate, got {pair!r:.60}")
    camera, e = pair
    check_time("t_us", e.t_us)
    if e.T_cam_port is not None:
        _check_covariance(e.covariance, camera)
        if not 0 < e.confidence <= 1:
            raise ValueError(f"estimates: expected confidences in (0, 1], got {e.confidence} from {camera}")
    return cast(tuple[str, Estimate], pair)


def _check_covariance(covariance, camera: str) -> None:
    """ValueError unless a pose's covariance is one: symmetric, with positive eigenvalues."""
    if covariance is None:
        raise ValueError(f"estimates: expected covariances, got none from {camera}")
    variances = np.diag(covariance)
    if not (np.all(np.isfinite(covariance)) and np.all(variances > 0)):
        raise ValueError(f"estimates: expected positive variances, got {variances.tolist()} from {camera}")
    correlation = covariance / np.sqrt(np.outer(variances, variances))
    lopsided, least = np.abs(correlation - correlation.T).max(), np.linalg.eigvalsh(correlation)[0]
    if lopsided > ROUNDED or least <= 0:
        raise ValueError(
            f"estimates: expected symmetric covariances with positive eigenvalues, got one from {camera} "
            f"whose correlations are lopsided by {lopsided:.2g}, with the least eigenvalue {least:.2g}"
        )
