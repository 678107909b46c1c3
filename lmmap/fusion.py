"""Estimates of both cameras in one Kalman filter on SE(3), as the port moves at nearly constant velocity.

The state is T_cam_port with its velocity v (m/s) and angular rate w (rad/s), all along the camera's axes; its
covariance (12, 12) is of (position, rotation, v, w), the rotation a left perturbation as in `uncertainty`.
White acceleration drives it.  From one time to the next

    p' = p + v dt,    R' = exp([w dt]x) R,

and an estimate (p_m, R_m) with covariance S is compared with it by

    y = (p_m - p, log(R_m Rz(k yaw_period) R^T)),    k with the smallest rotation.

Errors of neighbouring images are alike.  With correlation rho = exp(-dt / correlation_s), dt since the same
camera's last accepted estimate, S counts (1 + rho) / (1 - rho) times: then n estimates of a still port are
worth what n errors of that correlation are, 1 + (n - 1)(1 - rho) / (1 + rho) independent ones.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
from scipy.spatial.transform import Rotation

from .core import Estimate, Pose, Status
from .geometry import rotation_angle_rad, rotation_z

POSE, RATE = slice(0, 6), slice(6, 12)
FARTHEST = (Status.NO_RING, Status.NO_ELLIPSE, Status.NO_MARKERS)  # how far a failed image came


@dataclass(frozen=True)
class Motion:
    """What the filter assumes; all but the gate by `python benchmarks/tune_fusion.py`."""

    acceleration_m: float = 0.02  # square root of the acceleration's density, m / s^1.5
    acceleration_rad: float = 0.2  # rad / s^1.5
    correlation_s: float = 0.1  # of a camera's errors
    speed_m_s: float = 0.05  # standard deviation along each axis when nothing is known yet
    rate_rad_s: float = 0.15
    gate: float = 22.46  # squared Mahalanobis distance that 99.9 % of estimates keep (chi-square, 6)
    lost_s: float = 0.5  # without an accepted estimate: the next one starts anew


@dataclass(frozen=True)
class Track:
    """Pose, velocity (6,) and covariance (12, 12) at a time; ``seen_us`` of the last accepted estimate of
    each camera."""

    t_us: int
    T_cam_port: Pose
    velocity: np.ndarray
    covariance: np.ndarray
    seen_us: Mapping[str, int]

    def predicted(self, t_us: int, motion: Motion) -> Track:
        """The same at a later time."""
        dt = (t_us - self.t_us) * 1e-6
        if dt < 0:
            raise ValueError(f"t_us: expected {self.t_us} or later, got {t_us}")
        v, w = self.velocity[:3], self.velocity[3:]
        turn = Rotation.from_rotvec(w * dt).as_matrix()
        F = np.eye(12)
        F[0:3, 6:9] = dt * np.eye(3)
        F[3:6, 3:6] = turn
        F[3:6, 9:12] = dt * Rotation.from_rotvec(w * dt / 2).as_matrix()  # the left Jacobian, to dt^3
        density = np.repeat([motion.acceleration_m**2, motion.acceleration_rad**2], 3)
        Q = np.kron([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]], np.diag(density))
        T = Pose(turn @ self.T_cam_port.rotation, self.T_cam_port.position_m + v * dt)
        return replace(self, t_us=t_us, T_cam_port=T, covariance=_symmetric(F @ self.covariance @ F.T + Q))

    def corrected(self, y, S, seen_us: Mapping[str, int]) -> Track:
        """The same after a pose measured at y (6,) from this one with covariance S (6, 6); Joseph's form."""
        P = self.covariance
        K = np.linalg.solve(P[POSE, POSE] + S, P[POSE]).T
        keep = np.eye(12)
        keep[:, POSE] -= K
        step = K @ y
        T = Pose(
            Rotation.from_rotvec(step[3:6]).as_matrix() @ self.T_cam_port.rotation,
            self.T_cam_port.position_m + step[:3],
        )
        return replace(self, T_cam_port=T, velocity=self.velocity + step[RATE],
                       covariance=_symmetric(keep @ P @ keep.T + K @ S @ K.T),
                       seen_us={**self.seen_us, **seen_us})  # fmt: skip


class Fusion:
    """A track of the port, fed with estimates in the order of their times, asked at any time after.

    Parameters
    ----------
    yaw_period_rad
        The port's symmetry; estimates count as the nearest of their equals.
    """

    def __init__(self, yaw_period_rad: float, motion: Motion | None = None):
        self.motion, self.track = motion or Motion(), None
        self._turns = rotation_z(np.arange(round(2 * np.pi / yaw_period_rad)) * yaw_period_rad)
        self._statuses: dict[str, Status] = {}

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
        self._statuses |= {camera: e.status for camera, e in estimates.items()}
        poses = {camera: e for camera, e in estimates.items() if e.T_cam_port is not None}
        if missing := [camera for camera, e in poses.items() if e.covariance is None]:
            raise ValueError(f"estimates: expected covariances, got none from {', '.join(missing)}")
        track = self._at(t_us)
        if track is None and poses:
            first = min(poses, key=lambda camera: np.linalg.slogdet(poses[camera].covariance)[1])
            track = self.track = self._begun(poses.pop(first), first)
        information, vector, taken = np.zeros((6, 6)), np.zeros(6), {}
        for camera, e in poses.items():
            if (found := self._matched(track, e)) is None:
                continue
            y, S = found
            weight = np.linalg.inv(S * self._repetition(track, camera, t_us))
            information, vector, taken = information + weight, vector + weight @ y, {**taken, camera: t_us}
        if taken:
            S = np.linalg.inv(information)
            self.track = track.corrected(S @ vector, S, taken)

    def at(self, t_us: int) -> Estimate:
        """The estimate at a time not before the last one added; no pose while the track is lost."""
        track = self._at(t_us)
        if track is None:
            status = max(self._statuses.values(), key=_progress, default=Status.NO_RING)
            return Estimate(t_us, Status.NO_RING if status == Status.OK else status)
        return Estimate(t_us, Status.OK, track.T_cam_port, covariance=track.covariance[POSE, POSE])

    def _at(self, t_us: int) -> Track | None:
        if self.track is None or t_us - max(self.track.seen_us.values()) > 1e6 * self.motion.lost_s:
            return None
        return self.track.predicted(t_us, self.motion)

    def _begun(self, e: Estimate, camera: str) -> Track:
        rates = np.repeat([self.motion.speed_m_s**2, self.motion.rate_rad_s**2], 3)
        covariance = np.diag(np.concatenate([np.zeros(6), rates]))
        covariance[POSE, POSE] = e.covariance
        return Track(e.t_us, e.T_cam_port, np.zeros(6), covariance, {camera: e.t_us})

    def _matched(self, track: Track, e: Estimate):
        """Innovation (6,) and covariance (6, 6) of the estimate or of its rival; None beyond the gate."""
        choices = [(e.T_cam_port, e.covariance)]
        if e.rival is not None:
            choices.append((e.rival, _turned(e.covariance, e.T_cam_port.normal, e.rival.normal)))
        for T, S in choices:
            y = self._innovation(track.T_cam_port, T)
            if y @ np.linalg.solve(track.covariance[POSE, POSE] + S, y) <= self.motion.gate:
                return y, S
        return None

    def _innovation(self, T: Pose, measured: Pose) -> np.ndarray:
        turned = measured.rotation @ self._turns @ T.rotation.T
        nearest = turned[np.argmin(rotation_angle_rad(turned))]
        return np.concatenate([measured.position_m - T.position_m, Rotation.from_matrix(nearest).as_rotvec()])

    def _repetition(self, track: Track, camera: str, t_us: int) -> float:
        """(1 + rho) / (1 - rho) = coth(dt / 2 correlation_s); 1 for a camera's first estimate."""
        if camera not in track.seen_us or not self.motion.correlation_s:
            return 1.0
        dt = (t_us - track.seen_us[camera]) * 1e-6
        return float(1 / np.tanh(max(dt, 1e-6) / (2 * self.motion.correlation_s)))


def fuse(
    timed: Iterable[tuple[str, Estimate]],
    yaw_period_rad: float,
    rate_hz: float | None = None,
    motion: Motion | None = None,
) -> Iterator[Estimate]:
    """Fused estimates of ``(camera, estimate)`` in the order of time: after each time, or at ``rate_hz``
    from the first, each of what came until then.

    A camera's estimates count at their own times: a histogram's is the middle of its events' span.
    """
    fusion, tick, first_us = Fusion(yaw_period_rad, motion), 0, None
    for t_us, some in groupby(timed, key=lambda one: one[1].t_us):
        first_us = t_us if first_us is None else first_us
        while rate_hz and (tick_us := first_us + round(tick * 1e6 / rate_hz)) < t_us:
            yield fusion.at(tick_us)
            tick += 1
        fusion.add(dict(some))
        if not rate_hz:
            yield fusion.at(t_us)
    if rate_hz and first_us is not None and first_us + round(tick * 1e6 / rate_hz) == t_us:
        yield fusion.at(t_us)


def _turned(covariance, normal, rival) -> np.ndarray:
    """A pose's covariance for its rival: rotations are turned as the normal is, by the shortest way."""
    axis, cosine = np.cross(normal, rival), float(normal @ rival)
    cross = np.cross(np.eye(3), axis)  # [axis]x
    turn = np.eye(6)
    turn[3:, 3:] += cross + cross @ cross / max(1 + cosine, 1e-9)
    return turn @ covariance @ turn.T


def _progress(status: Status) -> int:
    return FARTHEST.index(status) if status in FARTHEST else -1


def _symmetric(A):
    return (A + A.T) / 2
