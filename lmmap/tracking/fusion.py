"""Estimates of both cameras in one Kalman filter on SE(3) with the constant-velocity `motion_model`.

A pose that passes the `gate` around the track corrects it.  Errors of successive images are correlated.  With
correlation rho = exp(-dt / correlation_s), dt since the same camera's last accepted estimate, a pose's
covariance counts (1 + rho) / (1 - rho) times: then n estimates of a still port are worth what n errors of
that correlation are, 1 + (n - 1)(1 - rho) / (1 + rho) independent ones.

A pose beyond the gate contradicts the track: at most one of them is right.  With the odds o = p / (1 - p) of
the track's belief and of each contradicting pose's confidence, each is right with the probability

    p_k' = o_k / (1 + sum o),

and a pose that is likelier than the track replaces it.  Poses that agree get the largest of their
probabilities, since their errors may have one cause.  A pose of which only the rival passes the gate
contradicts the track as well; while the track is likelier, the rival corrects it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from itertools import groupby
from typing import Any, cast

import numpy as np

from ..geometry.rotations import equal_turns
from ..settings import OURS, MotionSettings, Settings
from ..types import Estimate, Status, check_number, check_time, checked
from .discord import Discord, watched
from .gate import check_pair, match
from .motion_model import MotionState, repetition
from .within_limits import probability_within_limits

LEAST_HZ, MOST_HZ = 1e-6, 1e6  # of fused estimates: one in 12 days, or one a microsecond
MOST_BELIEF = 1 - 1e-9  # so that odds are finite
# how far a failed image came
STAGES = (Status.NO_RING, Status.NO_ELLIPSE, Status.NO_MARKERS, Status.UNSURE)


class Fusion:
    """A track of the port, fed with estimates in time order, that can be queried at any later time.

    Parameters
    ----------
    yaw_period_rad
        Period of the port's symmetry; each estimate is turned to the nearest equivalent pose.

    Attributes
    ----------
    belief : float
        Probability that the track follows the port, from the confidences of poses that agreed and disagreed.
    """

    def __init__(self, yaw_period_rad: float, motion: MotionSettings = OURS.motion):
        self.state: MotionState | None
        self.motion, self.state, self.belief = motion, None, 0.0
        self._ahead: tuple[MotionState, MotionState] | None = None  # a state, and what was predicted from it
        self.seen_us: dict[str, int] = {}  # of the last accepted estimate of each camera
        self._turns = equal_turns(yaw_period_rad)
        self._statuses: dict[str, Status] = {}

    def add(self, estimates: Mapping[str, Estimate]) -> None:
        """Take the estimates of one time, one from each camera that has an image then.

        Each pose is compared with the prediction.  Beyond the gate it contradicts the track, and its
        ``rival`` may replace it.  All accepted poses are applied at once, so their order does not matter.

        Raises
        ------
        ValueError
            If the times differ, or are before the last.
        """
        times = {e.t_us for e in estimates.values()}
        if len(times) != 1:
            raise ValueError(f"estimates: expected one time, got {sorted(times)}")
        (t_us,) = times
        check_time("t_us", t_us)
        seen: dict[str, Any] = {camera: e for camera, e in estimates.items() if e.T_cam_port is not None}
        track = self.predict(t_us)
        self._statuses |= {camera: e.status for camera, e in estimates.items()}
        if track is None and seen:
            first = min(seen, key=lambda camera: np.linalg.slogdet(seen[camera].covariance)[1])
            track = self._begin(first, e := seen.pop(first), e.confidence)
        if track is None:
            return
        information, vector, taken = np.zeros((6, 6)), np.zeros(6), {}
        belief, contradicting = self.belief, {}
        for camera, e in seen.items():
            close = match(track, e, self._turns, self.motion.gate)
            if close is None or close.is_rival:
                contradicting[camera] = e
            else:
                belief = max(belief, e.confidence)
            if close is not None:
                weight = np.linalg.inv(close.covariance * self._repetition(camera, t_us))
                information, vector = information + weight, vector + weight @ close.innovation
                taken[camera] = t_us
        if taken:
            S = np.linalg.inv(information)
            self.state, self.seen_us = track.correct(S @ vector, S), self.seen_us | taken
        self._doubt(belief, contradicting)

    def fits(self, e: Estimate) -> bool:
        """Whether there is a track, and the estimate or its rival passes the gate around it."""
        track = self.predict(e.t_us)
        both = track is not None and e.T_cam_port is not None
        return both and match(cast(MotionState, track), e, self._turns, self.motion.gate) is not None

    def at(self, t_us: int) -> Estimate:
        """The estimate at a time not before the last one added; no pose while the track is lost."""
        track = self.predict(t_us)
        if track is None:
            status = max(self._statuses.values(), key=_progress, default=Status.NO_RING)
            return Estimate(t_us, Status.NO_RING if status == Status.OK else status)
        return Estimate(t_us, Status.OK, track.T_cam_port, covariance=track.pose_covariance)

    def predict(self, t_us: int) -> MotionState | None:
        """The track's state at a time not before its own; None while there is no track."""
        if self.state is None or t_us - max(self.seen_us.values()) > 1e6 * self.motion.lost_s:
            return None
        if self._ahead is None or self._ahead[0] is not self.state or self._ahead[1].t_us != t_us:
            self._ahead = self.state, self.state.predict(t_us)
        return self._ahead[1]

    def _begin(self, camera: str, e: Estimate, belief: float) -> MotionState:
        assert e.T_cam_port is not None
        self.state = MotionState.start(e.t_us, e.T_cam_port, e.covariance, self.motion)
        self.seen_us, self.belief = {camera: e.t_us}, belief
        return self.state

    def _doubt(self, belief: float, contradicting: Mapping[str, Estimate]) -> None:
        """The track's belief after poses that contradict it, the surest of which may take its place."""
        if not contradicting:
            self.belief = belief
            return
        probabilities = [belief, *(e.confidence for e in contradicting.values())]
        odds = [p / (1 - p) for p in np.minimum(probabilities, MOST_BELIEF)]
        self.belief, *others = np.array(odds) / (1 + sum(odds))
        if max(others) > self.belief:
            camera = list(contradicting)[int(np.argmax(others))]
            self._begin(camera, contradicting[camera], max(others))

    def _repetition(self, camera: str, t_us: int) -> float:
        """1 for a camera's first estimate."""
        last_us = self.seen_us.get(camera)
        return 1.0 if last_us is None else repetition(1e-6 * (t_us - last_us), self.motion.correlation_s)


@checked
def fuse(timed: Iterable[tuple[str, Estimate]], yaw_period_rad: float, rate_hz: float | None = None,
         settings: Settings = OURS, name: str = "fuse") -> Iterator[Estimate]:  # fmt: skip
    """Fuse the estimates of both cameras, ``(camera, estimate)`` in time order: one result for each time, or
    at ``rate_hz`` from the first, from all estimates up to then.

    The ``confidence`` is the track's belief times the probability, by the covariance, that the pose is
    within the limits of a right one.  Below ``settings.min_fused_confidence`` the status is ``unsure``, as it
    is while the cameras contradict each other throughout (`discord.watched`); a warning that begins with
    ``name`` says so.

    A camera's estimates count at their own times: a histogram's is the middle of its events' span.  A ring
    without markers is ignored, because no marker confirms it.  In a gap there is no result later than
    ``settings.motion.lost_s`` after the last estimate, because there is no image to report on.

    Raises
    ------
    ValueError
        For a period outside 1 to 360 degrees, a rate outside 1e-6 to 1e6 Hz, a pose without covariance or
        confidence, and as `Fusion.add`.

    Examples
    --------
    >>> unseen = [("rgb", lmmap.Estimate(0, lmmap.Status.NO_RING))]
    >>> [e.status for e in lmmap.fuse(unseen, yaw_period_rad=np.radians(120))]
    [<Status.NO_RING: 'no_ring'>]
    """
    check_number("yaw_period_rad", yaw_period_rad, np.deg2rad(1), 2 * np.pi)
    if rate_hz is not None:
        check_number("rate_hz", rate_hz, LEAST_HZ, MOST_HZ)
    discord = Discord(yaw_period_rad, settings)

    def heard() -> Iterator[tuple[str, Estimate]]:
        for pair in timed:
            camera, e = check_pair(pair)
            discord.add(camera, e)
            yield camera, e

    answers = ((None, e) for e in _fused(heard(), yaw_period_rad, rate_hz, settings))
    return (e for _, e in watched(answers, discord, name))


def _fused(timed, yaw_period_rad: float, rate_hz: float | None, settings: Settings) -> Iterator[Estimate]:
    """As `fuse`, whether the cameras contradict each other or not."""
    fusion, tick, first_us, last_us = Fusion(yaw_period_rad, settings.motion), 0, None, None
    for t_us, estimates in groupby(timed, key=lambda camera_estimate: camera_estimate[1].t_us):
        first_us, last_us = (t_us, t_us) if first_us is None else (first_us, last_us)
        while rate_hz and (tick_us := first_us + round(tick * 1e6 / rate_hz)) < t_us:
            if tick_us - last_us > 1e6 * settings.motion.lost_s:
                tick = max(tick + 1, math.ceil((t_us - first_us) * rate_hz / 1e6))
                continue
            yield _judged(fusion, tick_us, settings)
            tick += 1
        last_us = t_us
        fusion.add(dict(estimates))
        if not rate_hz:
            yield _judged(fusion, t_us, settings)
    if rate_hz and first_us is not None and first_us + round(tick * 1e6 / rate_hz) == t_us:
        yield _judged(fusion, t_us, settings)


def _judged(fusion: Fusion, t_us: int, settings: Settings) -> Estimate:
    e = fusion.at(t_us)
    if e.T_cam_port is None:
        return e
    confidence = fusion.belief * probability_within_limits(e, settings)
    return e.judged(confidence, settings.min_fused_confidence)


def _progress(status: Status) -> int:
    return STAGES.index(status) if status in STAGES else -1
