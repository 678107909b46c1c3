"""Information from events about the port's pose.

Each event near an edge of the port measures where that edge is now, across the edge but not along it.  With
the distance e (px) from a piece of the predicted edge to its events, and the piece's row h of
`edges.Edges.jacobian`,

    e = h (dp, r) + noise,    information = sum h h' / var,    vector = sum h e / var,

so that a few thousand events become one matrix (6, 6) and one vector (6,).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry.rotations import step_between
from ..settings import BetweenSettings
from ..types import Pose
from .edges import EdgeFinder
from .motion_model import POSE, RATE, MotionState, repetition


@dataclass(frozen=True)
class EdgeInformation:
    """Information (6, 6) and vector (6,) about ``T_cam_port`` from a number of ``events`` around a time."""

    t_us: int
    T_cam_port: Pose
    information: np.ndarray
    vector: np.ndarray
    events: int

    def update(self, state: MotionState) -> MotionState:
        """Predict a state from an earlier time to this one, and correct it."""
        state = state.predict(self.t_us)
        off = step_between(self.T_cam_port, state.T_cam_port)
        return state.inform(self.information, self.vector - self.information @ off)


def edge_information(
    events, state: MotionState, visible: np.ndarray, finder: EdgeFinder, settings: BetweenSettings
) -> EdgeInformation | None:
    """Information from events (M,) of a short time about a predicted pose; None if no edge is known well
    enough.

    A ``visible`` (B,) piece of an edge counts if its position is known to half a gate and if it surely moves,
    because one that stands still makes no events.  Its motion determines their polarity.  Clutter has both
    polarities, so the other polarity's events are subtracted from the number n of events and from the sum of
    their distances; the mean then has the variance sigma^2 (n + n_other) / (n - n_other)^2 + common^2.
    """
    s, T, P = settings, state.T_cam_port, state.covariance
    J = finder.edges.jacobian(T, finder.camera)
    moves_px_s = J @ state.velocity
    place_sigma_px, moves_sigma_px_s = (np.sqrt(np.sum(J @ P[k, k] * J, 1)) for k in (POSE, RATE))
    usable = visible & (place_sigma_px < s.gate_px / 2)
    usable &= np.abs(moves_px_s) > s.sure_sigmas * moves_sigma_px_s
    count, sum_px = finder(events, T, usable, s.gate_px)
    sign = np.where(moves_px_s > 0, 1, -1)  # the bright side moves outward: pixels get brighter
    n, off_px = sign * (count[1] - count[0]), sign * (sum_px[1] - sum_px[0])
    clear = n > 0
    if not clear.any():
        return None
    J, n, total = J[clear], n[clear], count.sum(0)[clear]
    e = off_px[clear] / n - s.outward_px
    variance = s.sigma_px**2 * total / n**2 + s.common_px**2
    purity = n.sum() / count.sum()
    weight = purity**2 / (variance * repetition(1e-6 * s.period_us, s.correlation_s))
    return EdgeInformation(state.t_us, T, (J.T * weight) @ J, J.T @ (weight * e), int(n.sum()))
