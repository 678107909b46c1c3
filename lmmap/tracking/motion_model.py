"""A port that moves at nearly constant velocity: its pose and velocity with their covariance, how they are
predicted, and how a measured pose corrects them.

The state is T_cam_port with its velocity v (m/s) and angular rate w (rad/s), all along the camera's axes; its
covariance (12, 12) is of (position, rotation, v, w), the rotation a left perturbation as in `uncertainty`.
White acceleration drives it.  From one time to the next

    p' = p + v dt,    R' = exp([w dt]x) R.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..geometry.rotations import move, single_rotation_matrix, step_between
from ..settings import OURS, MotionSettings
from ..types import Pose

POSE, RATE = slice(0, 6), slice(6, 12)


def repetition(dt_s: float, correlation_s: float) -> float:
    """Factor on a camera's covariance ``dt_s`` after its last estimate, because their errors are correlated:
    (1 + rho) / (1 - rho) = coth(dt / 2 correlation_s)."""
    return float(1 / np.tanh(max(dt_s, 1e-6) / (2 * correlation_s))) if correlation_s else 1.0


@dataclass(frozen=True)
class MotionState:
    """Pose, velocity (6,) and covariance (12, 12) at a time, and the assumptions about the motion.

    No method changes a state; each returns a new one.
    """

    t_us: int
    T_cam_port: Pose
    velocity: np.ndarray
    covariance: np.ndarray
    motion: MotionSettings = OURS.motion

    @classmethod
    def start(cls, t_us: int, T_cam_port: Pose, covariance, motion: MotionSettings = OURS.motion):
        """Start at a measured pose with its covariance (6, 6), and a velocity of which only the typical
        magnitude is known."""
        rates = np.repeat([motion.speed_m_s**2, motion.rate_rad_s**2], 3)
        both = np.diag(np.concatenate([np.zeros(6), rates]))
        both[POSE, POSE] = covariance
        return cls(t_us, T_cam_port, np.zeros(6), both, motion)

    @property
    def pose_covariance(self) -> np.ndarray:
        """Covariance (6, 6) of ``T_cam_port`` alone."""
        return self.covariance[POSE, POSE]

    def predict(self, t_us: int) -> MotionState:
        """Predict the state at a later time.

        Raises
        ------
        ValueError
            For a time before the state's.
        """
        dt = (t_us - self.t_us) * 1e-6
        if not dt >= 0:  # NaN neither
            raise ValueError(f"t_us: expected {self.t_us} or later, got {t_us}")
        if dt == 0:
            return self
        v, w = self.velocity[:3], self.velocity[3:]
        turn = single_rotation_matrix(w * dt)
        F = np.eye(12)
        F[0:3, 6:9] = dt * np.eye(3)
        F[3:6, 3:6] = turn
        F[3:6, 9:12] = dt * single_rotation_matrix(w * dt / 2)  # the left Jacobian, to dt^3
        density = np.repeat([self.motion.acceleration_m**2, self.motion.acceleration_rad**2], 3)
        P, k = F @ self.covariance @ F.T, np.arange(6)
        P[k, k] += dt**3 / 3 * density
        P[k, k + 6] += dt**2 / 2 * density
        P[k + 6, k] += dt**2 / 2 * density
        P[k + 6, k + 6] += dt * density
        T = Pose(turn @ self.T_cam_port.rotation, self.T_cam_port.position_m + v * dt)
        return replace(self, t_us=t_us, T_cam_port=T, covariance=_symmetric(P))

    def update(self, T_cam_port: Pose, covariance) -> MotionState:
        """The state after a measured pose with its covariance (6, 6)."""
        return self.correct(step_between(self.T_cam_port, T_cam_port), covariance)

    def correct(self, y, S) -> MotionState:
        """The state after a pose measured at y (6,) from this one with covariance S (6, 6); Joseph's form."""
        P = self.covariance
        K = np.linalg.solve(P[POSE, POSE] + S, P[POSE]).T
        keep = np.eye(12)
        keep[:, POSE] -= K
        step = K @ y
        T = move(self.T_cam_port, step[POSE])
        return replace(self, T_cam_port=T, velocity=self.velocity + step[RATE],
                       covariance=_symmetric(keep @ P @ keep.T + K @ S @ K.T))  # fmt: skip

    def inform(self, information, vector) -> MotionState:
        """The state after measurements h of the pose with ``information`` sum h h' / var, (6, 6), possibly
        singular, and ``vector`` sum h y / var, (6,), of their differences y from this pose."""
        P, eye = self.covariance, np.eye(6)
        gain = np.linalg.solve((eye + information @ P[POSE, POSE]).T, P[POSE]).T  # P H' (I + L H P H')^-1
        step = gain @ vector
        T = move(self.T_cam_port, step[POSE])
        return replace(self, T_cam_port=T, velocity=self.velocity + step[RATE],
                       covariance=_symmetric(P - gain @ information @ P[POSE]))  # fmt: skip


def _symmetric(A):
    return (A + A.T) / 2
