"""Estimates of both cameras in one Kalman filter on SE(3) over a constant-velocity `motion`.

An estimate (p_m, R_m) with covariance S is compared with the track's pose (p, R) by

    y = (p_m - p, log(R_m Rz(k yaw_period) R^T)),    k with the smallest rotation.

Errors of neighbouring images are alike.  With correlation rho = exp(-dt / correlation_s), dt since the same
camera's last accepted estimate, S counts (1 + rho) / (1 - rho) times: then n estimates of a still port are
worth what n errors of that correlation are, 1 + (n - 1)(1 - rho) / (1 + rho) independent ones.

A ring without markers goes on with a track, and begins none: it corrects all but the yaw.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from itertools import groupby

import numpy as np

from ..geometry.rotations import equal_turns, rotation_angle_rad, single_rotation_vector
from ..settings import OURS, MotionSettings
from ..types import Estimate, Pose, Status, check_number, check_time
from .motion_model import MotionState, repetition

LONG_GAP_S = 10.0  # after the last estimate: a track is long lost, and ticks would only say so
LEAST_HZ, MOST_HZ = 1e-6, 1e6  # of fused estimates: one in 12 days, or one a microsecond
FREE_RAD = 30.0  # standard deviation of a yaw that is not measured
# how far a failed image came
STAGES = (Status.NO_RING, Status.NO_ELLIPSE, Status.NO_MARKERS, Status.UNSURE)


class Fusion:
    """A track of the port, fed with estimates in the order of their times, asked at any time after.

    Parameters
    ----------
    yaw_period_rad
        The port's symmetry; estimates count as the nearest of their equals.
    """

    def __init__(self, yaw_period_rad: float, motion: MotionSettings = OURS.motion):
        check_number("yaw_period_rad", yaw_period_rad, np.deg2rad(1), 2 * np.pi)
        self.motion, self.state = motion, None
        self._ahead: tuple[MotionState, MotionState] | None = None  # a state, and what was predicted from it
        self.seen_us: dict[str, int] = {}  # of the last accepted estimate of each camera
        self._turns = equal_turns(yaw_period_rad)
        self._unknown_rad = yaw_period_rad / np.sqrt(12)
        self._statuses: dict[str, Status] = {}
        self._matched: tuple = None, None, None  # a track, an estimate, and how they match

    def add(self, estimates: Mapping[str, Estimate]) -> None:
        """Take the estimates of one time, one of each camera that has an image then.

        Each is compared with the prediction; beyond the gate its ``rival`` may stand in for it, and else it
        is not taken.  All that are taken count at once, so their order does not matter.

        Raises
        ------
        ValueError
            For different times, a time before the last, or a pose without covariance.
        """
        times = {e.t_us for e in estimates.values()}
        if len(times) != 1:
            raise ValueError(f"estimates: expected one time, got {sorted(times)}")
        (t_us,) = times
        check_time("t_us", t_us)
        self._statuses |= {camera: e.status for camera, e in estimates.items()}
        seen = {camera: e for camera, e in estimates.items() if (e.T_cam_port or e.ring) is not None}
        if missing := [camera for camera, e in seen.items() if e.covariance is None]:
            raise ValueError(f"estimates: expected covariances, got none from {', '.join(missing)}")
        for camera, e in seen.items():
            if np.shape(e.covariance) != (6, 6) or not np.all(np.isfinite(e.covariance)):
                raise ValueError(f"estimates: expected a finite covariance (6, 6), got another from {camera}")
            if not np.all(np.diag(e.covariance) > 0):
                variances = np.diag(e.covariance).tolist()
                raise ValueError(f"estimates: expected positive variances, got {variances} from {camera}")
        track, whole = (
            self.predict(t_us),
            [camera for camera, e in seen.items() if e.T_cam_port is not None],
        )
        if track is None and whole:
            first = min(whole, key=lambda camera: np.linalg.slogdet(seen[camera].covariance)[1])
            e = seen.pop(first)
            track = self.state = MotionState.start(t_us, e.T_cam_port, e.covariance, self.motion)
            self.seen_us = {first: t_us}
        if track is None:
            return
        information, vector, taken = np.zeros((6, 6)), np.zeros(6), {}
        for camera, e in seen.items():
            if (match := self._match(track, e)) is None:
                continue
            y, S = match
            weight = np.linalg.inv(S * self._repetition(camera, t_us))
            information, vector, taken = information + weight, vector + weight @ y, {**taken, camera: t_us}
        if taken:
            S = np.linalg.inv(information)
            self.state, self.seen_us = track.correct(S @ vector, S), self.seen_us | taken

    def fits(self, e: Estimate) -> bool:
        """Whether there is a track, and the estimate or its rival keeps the gate about it."""
        track, measured = self.predict(e.t_us), e.T_cam_port or e.ring
        return track is not None and measured is not None and self._match(track, e) is not None

    def at(self, t_us: int) -> Estimate:
        """The estimate at a time not before the last one added; no pose while the track is lost, or its yaw
        was, when last seen, less known than by a guess: a camera's pose may have a guessed yaw, but rings
        alone do not go on with it."""
        track = self.predict(t_us)
        if track is None:
            status = max(self._statuses.values(), key=_progress, default=Status.NO_RING)
            return Estimate(t_us, Status.NO_RING if status == Status.OK else status)
        n = self.state.T_cam_port.normal
        if n @ self.state.covariance[3:6, 3:6] @ n > (1 + 1e-6) * self._unknown_rad**2:
            return Estimate(t_us, Status.NO_MARKERS)
        return Estimate(t_us, Status.OK, track.T_cam_port, covariance=track.pose_covariance)

    def predict(self, t_us: int) -> MotionState | None:
        """The track's state at a time not before its own; None while there is no track."""
        if self.state is None or t_us - max(self.seen_us.values()) > 1e6 * self.motion.lost_s:
            return None
        if self._ahead is None or self._ahead[0] is not self.state or self._ahead[1].t_us != t_us:
            self._ahead = self.state, self.state.predict(t_us)
        return self._ahead[1]

    def _match(self, track: MotionState, e: Estimate):
        """Innovation (6,) and covariance (6, 6) of the estimate, or of its rival where only that keeps the
        gate; of a ring, of the nearer of its two poses; None beyond the gate."""
        if self._matched[0] is not track or self._matched[1] is not e:
            self._matched = track, e, self._compare(track, e)
        return self._matched[2]

    def _compare(self, track: MotionState, e: Estimate):
        whole = e.T_cam_port is not None
        first, second = (e.T_cam_port, e.rival) if whole else (e.ring, e.twin)
        choices = [(first, e.covariance)]
        if second is not None:
            choices.append((second, _rotate_covariance(e.covariance, first.normal, second.normal)))
        within_gate = []
        for T, S in choices:
            n = T.normal
            y = self._innovation(track.T_cam_port, T) if whole else _to_ring(track.T_cam_port, T)
            S = S if whole else S + np.pad(FREE_RAD**2 * np.outer(n, n), ((3, 0), (3, 0)))
            distance = y @ np.linalg.solve(track.pose_covariance + S, y)
            if distance <= self.motion.gate:
                within_gate.append((distance, y, S))
        if not within_gate:
            return None
        _, y, S = within_gate[0] if whole else min(within_gate, key=lambda choice: choice[0])
        return y, S

    def _innovation(self, T: Pose, measured: Pose) -> np.ndarray:
        turned = measured.rotation @ self._turns @ T.rotation.T
        nearest = turned[np.argmin(rotation_angle_rad(turned))]
        return np.concatenate([measured.position_m - T.position_m, single_rotation_vector(nearest)])

    def _repetition(self, camera: str, t_us: int) -> float:
        """1 for a camera's first estimate."""
        if camera not in self.seen_us:
            return 1.0
        return repetition(1e-6 * (t_us - self.seen_us[camera]), self.motion.correlation_s)


def fuse(
    timed: Iterable[tuple[str, Estimate]],
    yaw_period_rad: float,
    rate_hz: float | None = None,
    motion: MotionSettings = OURS.motion,
) -> Iterator[Estimate]:
    """Fused estimates of ``(camera, estimate)`` in the order of time: after each time, or at ``rate_hz``
    from the first, each of what came until then.

    A camera's estimates count at their own times: a histogram's is the middle of its events' span.  Ticks of
    a gap, `LONG_GAP_S` after the last estimate, are passed over.

    Raises
    ------
    ValueError
        For a period beyond 1 to 360 degrees, a rate beyond 1e-6 to 1e6 Hz, and as `Fusion.add`.
    """
    if rate_hz is not None:
        check_number("rate_hz", rate_hz, LEAST_HZ, MOST_HZ)
    fusion, tick, first_us, last_us = Fusion(yaw_period_rad, motion), 0, None, None
    for t_us, estimates in groupby(timed, key=lambda camera_estimate: camera_estimate[1].t_us):
        first_us, last_us = (t_us, t_us) if first_us is None else (first_us, last_us)
        while rate_hz and (tick_us := first_us + round(tick * 1e6 / rate_hz)) < t_us:
            if tick_us - last_us > 1e6 * LONG_GAP_S:
                tick = max(tick + 1, math.ceil((t_us - first_us) * rate_hz / 1e6))
                continue
            yield fusion.at(tick_us)
            tick += 1
        last_us = t_us
        fusion.add(dict(estimates))
        if not rate_hz:
            yield fusion.at(t_us)
    if rate_hz and first_us is not None and first_us + round(tick * 1e6 / rate_hz) == t_us:
        yield fusion.at(t_us)


def _to_ring(T: Pose, ring: Pose) -> np.ndarray:
    """Position difference (m), and the shortest rotation vector that turns the normal into the ring's."""
    axis = np.cross(T.normal, ring.normal)
    sine = np.linalg.norm(axis)
    angle = np.arctan2(sine, T.normal @ ring.normal)
    return np.concatenate([ring.position_m - T.position_m, axis * (angle / sine if sine > 1e-12 else 1.0)])


def _rotate_covariance(covariance, normal, rival) -> np.ndarray:
    """A pose's covariance for its rival: rotations are turned as the normal is, by the shortest way."""
    axis, cosine = np.cross(normal, rival), float(normal @ rival)
    cross = np.cross(np.eye(3), axis)  # [axis]x
    turn = np.eye(6)
    turn[3:, 3:] += cross + cross @ cross / max(1 + cosine, 1e-9)
    return turn @ covariance @ turn.T


def _progress(status: Status) -> int:
    return STAGES.index(status) if status in STAGES else -1
