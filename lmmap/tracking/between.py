"""Poses between images, from events alone.

An image's pose is old when it arrives: first its events were accumulated, then it was computed.  Meanwhile
`edge_information` turns a few thousand events into one matrix and one vector for the Kalman filter.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from typing import Any, cast

import numpy as np

from ..geometry.rotations import move
from ..settings import OURS, BetweenSettings
from ..types import EVENT, Camera, Estimate, Port, Pose, concatenate_events
from .edge_information import EdgeInformation, edge_information
from .edges import EdgeFinder
from .fusion import Fusion
from .motion_model import MotionState

MEMORY_S = 2.0  # how far back an image may reach
SAME_VIEW_S = 0.01  # so long, plate and petals hide the same pieces of edges


class Between:
    """A track that is corrected by estimates of images and by the events between them, each at its own time.

    Estimates may be older than events already used: the track then returns to their time and applies the
    information from later events again.

    Parameters
    ----------
    camera, port
        Those that the events are from.
    settings
        Default: ``OURS.between``.
    """

    def __init__(self, camera: Camera, port: Port, settings: BetweenSettings = OURS.between):
        self.camera, self.port, self.settings = camera, port, settings
        self.used = 0  # events at an edge so far
        self.restart()

    def restart(self) -> None:
        """Forget the track and all information from events."""
        self._fusion = Fusion(self.port.yaw_period_rad, self.settings.motion)
        self._past: deque[tuple[MotionState, EdgeInformation | None]] = deque()
        self._image_us: int | None
        self._visible: np.ndarray | None
        self._visible_us: int | None
        self._waiting, self._image_us = np.zeros(0, EVENT), None
        self._visible, self._visible_us = None, None

    @cached_property
    def _finder(self) -> EdgeFinder:
        return EdgeFinder(self.port, self.camera)

    @property
    def state(self) -> MotionState | None:
        """The track after its last update; None before the first pose."""
        return self._past[-1][0] if self._past else None

    @property
    def first_us(self) -> int | float:
        """The earliest time (us) that can be queried: that of the last estimate taken, within `MEMORY_S`."""
        known = [self._image_us] * (self._image_us is not None) + [s.t_us for s, _ in list(self._past)[:1]]
        return max(cast(list[int], known), default=-np.inf)

    @property
    def seen_us(self) -> int | float:
        """The time (us) of the last estimate that the track accepted."""
        return max(self._fusion.seen_us.values(), default=-np.inf)

    def add(self, estimates: Mapping[str, Estimate]) -> None:
        """Take the estimates of one time, as `fusion.Fusion.add`.

        Raises
        ------
        ValueError
            As there, and for a time before the last estimates or older than `MEMORY_S`.
        """
        t_us = min(e.t_us for e in estimates.values())
        with self.before(t_us) as fusion:
            fusion.add({camera: self.as_late(camera, e, fusion) for camera, e in estimates.items()})
            self._image_us = t_us

    @contextmanager
    def before(self, t_us: int) -> Iterator[Fusion]:
        """Give the track as it was known at a time, to be queried or corrected; information from later events
        is applied again afterwards.

        Raises
        ------
        ValueError
            For a time before `first_us`.
        """
        if t_us < self.first_us:
            raise ValueError(f"t_us: expected {self.first_us} or later, got {t_us}")
        since: list[tuple[MotionState, Any]] = []  # with what events said
        while self._past and self._past[-1][0].t_us > t_us:
            since.append(self._past.pop())
        known = self._fusion.state = self.state
        try:
            yield self._fusion
        finally:
            changed = self._fusion.state is not known
            if changed:
                self._keep(cast(MotionState, self._fusion.state), None)
            for state, information in reversed(since):
                self._keep(information.update(self.state) if changed else state, information)
            self._fusion.state = self.state

    def events(self, events) -> int:
        """Take events (M,) EVENT in time order; return how many updates they made.

        An update uses the events of one ``settings.period_us``.  The last ones wait for the next call, since
        more may belong to their period.

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
        """The estimate at a time not before `first_us`, from what was known then, as `fusion.Fusion.at`."""
        if self.state is None or t_us >= self.state.t_us:
            return self._now(self._fusion, t_us)
        with self.before(t_us) as fusion:
            return self._now(fusion, t_us)

    def as_late(self, camera: str, e: Estimate, fusion: Fusion) -> Estimate:
        """An estimate shifted to what events of its time would show, since events are late and frames not."""
        state = fusion.predict(e.t_us)
        if camera == "event" or state is None or e.T_cam_port is None:
            return e
        back = -1e-6 * self.settings.late_us * state.velocity
        return replace(e, T_cam_port=move(e.T_cam_port, back))

    def measure(self, events) -> EdgeInformation | None:
        """What events of a short time say about the predicted pose (`edge_information`); None without a
        track."""
        t_us = int(events["t_us"].mean())
        if self.state is None or t_us < self.state.t_us or (state := self._fusion.predict(t_us)) is None:
            return None
        visible = self._visible_pieces(t_us, state.T_cam_port)
        return edge_information(events, state, visible, self._finder, self.settings)

    def _now(self, fusion: Fusion, t_us: int) -> Estimate:
        """The track is where its events show the port, and these are late."""
        e = fusion.at(t_us + self.settings.late_us)
        if e.T_cam_port is None:
            return replace(e, t_us=t_us)
        off = 1e-6 * self.settings.late_sigma_us * cast(MotionState, fusion.predict(e.t_us)).velocity
        return replace(e, t_us=t_us, covariance=cast(np.ndarray, e.covariance) + np.outer(off, off))

    def _visible_pieces(self, t_us: int, T_cam_port: Pose) -> np.ndarray:
        if self._visible_us is None or t_us > self._visible_us + 1e6 * SAME_VIEW_S:
            self._visible_us = t_us
            self._visible = self._finder.edges.visible(T_cam_port, self._finder.port, self._finder.camera)
        return cast(np.ndarray, self._visible)

    def _update(self, events) -> bool:
        if (information := self.measure(events)) is None:
            return False
        self._fusion.state = information.update(cast(MotionState, self._fusion.predict(information.t_us)))
        self._keep(self._fusion.state, information)
        self.used += information.events
        return True

    def _keep(self, state: MotionState, information: EdgeInformation | None) -> None:
        self._past.append((state, information))
        while self._past[0][0].t_us < state.t_us - 1e6 * MEMORY_S:
            self._past.popleft()
