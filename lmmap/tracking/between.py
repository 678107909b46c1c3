"""Poses between images, from events alone.

An image's pose is old when it comes: its events were counted for a while, and then it was computed.
Meanwhile each event near an edge of the port says where that edge is now: across the edge, and nothing along
it.  With the distance e (px) from a piece of the predicted edge to its events, and the piece's row h of
`edges.Edges.jacobian`,

    e = h (dp, r) + noise,    information = sum h h' / var,    vector = sum h e / var,

so that a few thousand events become one matrix (6, 6) and one vector (6,) for the Kalman filter.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..pipeline.histograms import concatenate_events
from ..settings import OURS, BetweenSettings
from ..types import EVENT, Camera, Estimate, Port, Pose
from .edges import EdgeFinder
from .fusion import Fusion
from .motion_model import POSE, RATE, MotionState, repetition

MEMORY_S = 2.0  # how far back an image may reach
SAME_VIEW_S = 0.01  # so long, plate and petals hide the same pieces of edges


@dataclass(frozen=True)
class EdgeInformation:
    """What ``events`` events around a time say of the pose: information (6, 6) and vector (6,) about
    ``T_cam_port``."""

    t_us: int
    T_cam_port: Pose
    information: np.ndarray
    vector: np.ndarray
    events: int

    def update(self, state: MotionState) -> MotionState:
        """A state of an earlier time, predicted and corrected."""
        state = state.predict(self.t_us)
        turn = state.T_cam_port.rotation @ self.T_cam_port.rotation.T
        off = np.concatenate([state.T_cam_port.position_m - self.T_cam_port.position_m,
                              Rotation.from_matrix(turn).as_rotvec()])  # fmt: skip
        return state.inform(self.information, self.vector - self.information @ off)


class Between:
    """A track that estimates of images and the events between them correct, each at its own time.

    Estimates may be older than events that were taken before: then the track goes back to their time, and
    takes again what the events have said since.

    Parameters
    ----------
    camera, port
        Of the events.
    settings
        Default: ``OURS.between``.
    """

    def __init__(self, camera: Camera, port: Port, settings: BetweenSettings = OURS.between):
        self.settings = settings
        self._fusion = Fusion(port.yaw_period_rad, settings.motion)
        self._finder = EdgeFinder(port, camera)
        self._past: deque[tuple[MotionState, EdgeInformation | None]] = deque()
        self._waiting, self._image_us = np.zeros(0, EVENT), None
        self._visible, self._visible_us = None, None
        self.used = 0  # events at an edge so far

    @property
    def state(self) -> MotionState | None:
        """The track after its last update; None before the first pose."""
        return self._past[-1][0] if self._past else None

    def add(self, estimates: Mapping[str, Estimate]) -> None:
        """Take the estimates of one time, as `fusion.Fusion.add`.

        Raises
        ------
        ValueError
            As there, and for a time before the last estimates' or beyond `MEMORY_S`.
        """
        t_us, again = min(e.t_us for e in estimates.values()), []
        first_us = max(
            [us for us in (self._image_us, self._past and self._past[0][0].t_us) if us], default=t_us
        )
        if t_us < first_us:
            raise ValueError(f"estimates: expected {first_us} us or later, got {t_us}")
        while self._past and self._past[-1][0].t_us > t_us:
            again.append(self._past.pop()[1])
        if self._past:
            self._fusion.state = self.state
        self._fusion.add(estimates)
        self._image_us = t_us
        if self._fusion.state is not None:
            self._past.append((self._fusion.state, None))
        for information in reversed(again):
            self._append(information)

    def events(self, events) -> int:
        """Take events (M,) EVENT in the order of time; returns how many updates they made.

        An update takes those of ``settings.period_us``.  The last ones wait for the next call, as more may
        belong to their period.

        Raises
        ------
        ValueError
            For times that go back.
        """
        waiting = concatenate_events([self._waiting, events])
        if np.any(back := np.diff(waiting["t_us"]) < 0):
            before, after = waiting["t_us"][np.argmax(back) :][:2]
            raise ValueError(f"events: expected times in order, got {after} us after {before} us")
        cuts = np.flatnonzero(np.diff(waiting["t_us"] // self.settings.period_us)) + 1
        *whole, self._waiting = np.split(waiting, cuts)
        return sum(self._update(piece) for piece in whole)

    def at(self, t_us: int) -> Estimate:
        """The estimate at a time not before the last update's, as `fusion.Fusion.at`."""
        return self._fusion.at(t_us)

    def measure(self, events) -> EdgeInformation | None:
        """What events of a short time say about the predicted pose; None where no edge is known well enough.

        A piece of an edge counts while its place is known to half a gate, and while it moves for sure: one
        that stands still makes no events.  Its motion says which polarity they have.  Clutter has both: what
        the other polarity holds is taken away from the events' number n and from the sum of their distances,
        so that their mean has the variance sigma^2 (n + n_other) / (n - n_other)^2 + common^2.
        """
        s, t_us = self.settings, int(events["t_us"].mean())
        if self.state is None or t_us < self.state.t_us:
            return None
        state = self.state.predict(t_us)
        T, P = state.T_cam_port, state.covariance
        J = self._finder.edges.jacobian(T, self._finder.camera)
        moves_px_s = J @ state.velocity
        place_sigma_px, moves_sigma_px_s = (np.sqrt(np.sum(J @ P[k, k] * J, 1)) for k in (POSE, RATE))
        usable = self._visible_pieces(t_us, T) & (place_sigma_px < s.gate_px / 2)
        usable &= np.abs(moves_px_s) > s.sure_sigmas * moves_sigma_px_s
        count, sum_px = self._finder(events, T, usable, s.gate_px)
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
        return EdgeInformation(t_us, T, (J.T * weight) @ J, J.T @ (weight * e), int(n.sum()))

    def _visible_pieces(self, t_us: int, T_cam_port: Pose) -> np.ndarray:
        if self._visible_us is None or t_us > self._visible_us + 1e6 * SAME_VIEW_S:
            self._visible_us = t_us
            self._visible = self._finder.edges.visible(T_cam_port, self._finder.port, self._finder.camera)
        return self._visible

    def _update(self, events) -> bool:
        if (information := self.measure(events)) is None:
            return False
        self._append(information)
        self.used += information.events
        while self._past[0][0].t_us < information.t_us - 1e6 * MEMORY_S:
            self._past.popleft()
        return True

    def _append(self, information: EdgeInformation) -> None:
        self._fusion.state = information.update(self.state)
        self._past.append((self._fusion.state, information))
