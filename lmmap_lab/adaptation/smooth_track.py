"""Where the port was at a time, by the poses before and after it.

A track forward in time and one backward, each a `Fusion` of both cameras, are asked for the same time.  Where
they exclude each other nothing is said.  What keeps the gate is joined: for poses at y from the forward one,

    K = P_f (P_f + P_b)^-1,    P = P_f - K P_f,    step = K y.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from lmmap.geometry.rotations import equal_turns, move, step_between
from lmmap.settings import OURS, MotionSettings
from lmmap.tracking.fusion import Fusion
from lmmap.tracking.motion_model import MotionState
from lmmap.types import Estimate

REACH_S = 1.5  # to the nearest pose of a track; images are looked at some times a second only
MOTION = replace(OURS.motion, lost_s=REACH_S)


class SmoothTrack:
    """A port's motion by the estimates of one camera or several.

    Parameters
    ----------
    estimates
        ``(camera, estimate)`` of a recording in any order; those without a pose do not matter.
    yaw_period_rad
        The port's symmetry.
    """

    def __init__(self, estimates: Iterable[tuple[str, Estimate]], yaw_period_rad: float,
                 motion: MotionSettings = MOTION):  # fmt: skip
        seen = sorted(((c, e) for c, e in estimates if e.T_cam_port is not None), key=lambda ce: ce[1].t_us)
        self._seen, self._yaw_period_rad = seen, yaw_period_rad
        self._last_us = seen[-1][1].t_us if seen else 0
        back = [(c, replace(e, t_us=self._last_us - e.t_us)) for c, e in reversed(seen)]
        self._forward, self._backward = (_states(own, yaw_period_rad, motion) for own in (seen, back))
        self._turns, self._motion = equal_turns(yaw_period_rad), motion

    def with_more(self, estimates: Iterable[tuple[str, Estimate]]) -> SmoothTrack:
        """The track by these estimates as well."""
        return SmoothTrack([*self._seen, *estimates], self._yaw_period_rad, self._motion)

    def at(self, t_us: int, with_own: bool = True) -> MotionState | None:
        """Pose and covariance at a time, its velocity left out; None where no track reaches or two contradict
        each other.  ``with_own``: whether estimates of this very time count."""
        sides = [
            _predicted(self._forward, t_us, with_own, self._motion.lost_s),
            _predicted(self._backward, self._last_us - t_us, False, self._motion.lost_s),
        ]
        known = [state for state in sides if state is not None]
        if len(known) < 2:
            return self._still(t_us, known[0].T_cam_port, known[0].pose_covariance) if known else None
        first, second = known
        y = step_between(first.T_cam_port, second.T_cam_port, self._turns)
        P, S = first.pose_covariance, first.pose_covariance + second.pose_covariance
        if y @ np.linalg.solve(S, y) > self._motion.gate:
            return None
        K = np.linalg.solve(S, P).T
        joined = P - K @ P
        return self._still(t_us, move(first.T_cam_port, K @ y), (joined + joined.T) / 2)

    def _still(self, t_us: int, T_cam_port, covariance) -> MotionState:
        return MotionState.start(t_us, T_cam_port, covariance, self._motion)


def _states(estimates, yaw_period_rad: float, motion: MotionSettings) -> tuple[list[int], list[MotionState]]:
    """Times in order, and the track's state after the estimates of each."""
    fusion, times_us, states = Fusion(yaw_period_rad, motion), [], []
    for camera, e in estimates:
        fusion.add({camera: e})
        times_us.append(e.t_us)
        states.append(fusion.state)
    return times_us, states


def _predicted(track, t_us: int, with_own: bool, reach_s: float) -> MotionState | None:
    """A track's state at a time by what was known before; None where that is too long ago."""
    times_us, states = track
    k = (bisect_right if with_own else bisect_left)(times_us, t_us) - 1
    if k < 0 or t_us - states[k].t_us > 1e6 * reach_s:
        return None
    return states[k].predict(t_us)
