"""Robot-world hand-eye calibration: where the camera and the port are on an arm, from detections.

An arm reports ``T_root_tip(t)``, where ``root`` is its end on the camera's side and ``tip`` its end on the
port's.  The camera is fixed to the root and the port to the tip, so that a detection sees

    T_cam_port(t) = T_cam_root  T_root_tip(t + delay)  T_tip_port

with positions divided by ``scale``, the true size of the ring over the assumed one.  The equation is from
Zhuang, Roth & Sudhakar (1994); scale, delay and robust weights are ours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from lmmap.geometry.rotations import equal_turns, rotation_angle_rad
from lmmap.types import Pose, frozen_array

from .hand_eye_starts import SIGMA_M, SIGMA_RAD, starting_points
from .ur5e import ArmSamples

FLOOR_M, FLOOR_RAD = 0.0005, np.deg2rad(0.2)  # added to every covariance
SUBSET, BLOCKS = 80, 10  # detections that choose a start; blocks of the jackknife
CUT = chi2.ppf(0.999, 6)  # a detection this far off (squared, in standard deviations) has no weight
MOST_M, MOST_RAD = 0.05, np.deg2rad(5.0)  # a transform that is known worse than this is refused
PRIOR = np.array([0.5, 0.1])  # wide standard deviations of log(scale) and delay (s), if data do not decide


@dataclass(frozen=True)
class HandEye:
    """A calibration and how well it is known.

    ``sigma`` (14,) are standard deviations of T_cam_root (m, rad), T_tip_port (m, rad), log(scale) and delay
    (s).  ``kept`` (N,) says which detections had weight.  ``errors_m`` and ``errors_rad`` (N,) are errors of
    each detection against a fit that has not seen its stretch of time.
    """

    T_cam_root: Pose
    T_tip_port: Pose
    scale: float
    delay_s: float
    sigma: np.ndarray
    kept: np.ndarray
    errors_m: np.ndarray
    errors_rad: np.ndarray

    def __post_init__(self):
        for name in ("sigma", "errors_m", "errors_rad"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))


class _Problem:
    """Residuals (N, 6) of the detections, and fits of them.

    Parameters ``x`` (14,) are small motions of T_cam_root and T_tip_port away from ``X`` and ``Y``,
    log(scale) and delay.
    """

    def __init__(self, detected: Pose, arm: ArmSamples, whitener, turns, X: Pose, Y: Pose):
        self.detected, self.arm, self.whitener, self.turns = detected, arm, whitener, turns
        self.X, self.Y = X, Y

    def transforms(self, x) -> tuple[Pose, Pose]:
        return _move(self.X, x[:6]), _move(self.Y, x[6:12])

    def errors(self, x, rows=slice(None)):
        """Errors of the detections' positions (M, 3) m and rotations (M, 3) rad, in the camera's axes."""
        X, Y = self.transforms(x)
        T = X @ _move(self.arm.T_root_tip[rows], self.arm.velocity[rows] * x[13]) @ Y
        seen = self.detected.rotation[rows, None] @ self.turns
        nearest = np.argmax(np.einsum("nkij,nij->nk", seen, T.rotation), 1)
        rotation = rotation_vector(seen[np.arange(len(seen)), nearest] @ np.swapaxes(T.rotation, -1, -2))
        return self.detected.position_m[rows] - T.position_m * np.exp(-x[12]), rotation

    def residuals(self, x, rows=slice(None)) -> np.ndarray:
        """Errors in units of their standard deviations, uncorrelated, (M, 6)."""
        return np.einsum("nij,nj->ni", self.whitener[rows], np.hstack(self.errors(x, rows)))

    def minimise(self, x, free, rows, weight=1.0, variance: float = 1.0, **options):
        """Least squares over the entries ``free`` of ``x``, with the prior: ``x`` and SciPy's result."""

        def put(values):
            y = x.copy()
            y[free] = values
            return y

        def stack(values):
            y = put(values)
            prior = np.sqrt(variance) * y[12:] / PRIOR
            return np.concatenate([(weight * self.residuals(y, rows)).ravel(), prior])

        result = least_squares(stack, x[free], x_scale="jac", **options)
        return put(result.x), result

    def fit(self, x, free, rows, rounds: int = 6):
        """Fit with Tukey's biweight from ``x``: the parameters, variance, weights (M,) and Jacobian."""
        for k in range(rounds):
            squared = np.sum(self.residuals(x, rows) ** 2, -1)
            variance = np.median(squared) / chi2.median(6)
            weight = np.clip(1 - squared / (variance * CUT), 0, None)  # its root is the residual's factor
            before, (x, result) = x, self.minimise(x, free, rows, weight[:, None], variance, max_nfev=8)
            if k and np.abs(x - before).max() < 1e-7:
                break
        return x, variance, weight, result.jac


def _move(T: Pose, motion) -> Pose:
    """Poses after a motion (..., 6): shifted (m), and turned (rad) about their own origins."""
    return Pose(
        Rotation.from_rotvec(motion[..., 3:]).as_matrix() @ T.rotation, T.position_m + motion[..., :3]
    )


def solve(detected: Pose, arm: ArmSamples, yaw_period_rad: float, covariance=None,
          T_cam_root: Pose | None = None) -> HandEye:  # fmt: skip
    """Calibrate from detections ``T_cam_port`` (N,) in the order of time, yaw modulo its period.

    Parameters
    ----------
    detected : (N,); outliers and wrong yaws are expected among them
    arm : at the detections' times by the camera's clock
    covariance : (N, 6, 6) of the detections, as in `Estimate`; default: the same for all
    T_cam_root : if it is known; then only the rest is estimated

    Returns
    -------
    HandEye
        Of the equivalent yaws of ``T_tip_port`` it has the least turn.  Uncertainty and errors come from
        leaving out each of ten stretches of time in turn (a jackknife), because a detection's error resembles
        its neighbours'.

    Raises
    ------
    ValueError
        If the detections are too few, or the arm turns and moves too little for them to decide.
    """
    if len(detected) < 2 * BLOCKS:
        raise ValueError(f"{len(detected)} detections while the arm reports, {2 * BLOCKS} are needed")
    turns = equal_turns(yaw_period_rad)
    if covariance is None:
        covariance = np.diag(np.repeat([SIGMA_M**2, SIGMA_RAD**2], 3))[None].repeat(len(detected), 0)
    floor = np.diag(np.repeat([FLOOR_M**2, FLOOR_RAD**2], 3))
    whitener = np.linalg.inv(np.linalg.cholesky(np.asarray(covariance) + floor))

    subset = np.unique(np.linspace(0, len(detected) - 1, SUBSET).astype(int))
    free, fits = np.arange(6 if T_cam_root else 0, 14), []
    for X, Y, scale in starting_points(detected[subset], arm.T_root_tip[subset], turns, T_cam_root):
        problem = _Problem(detected, arm, whitener, turns, T_cam_root or X, Y)
        x = np.r_[np.zeros(12), np.log(scale), 0.0]
        x, result = problem.minimise(x, free, subset, loss="cauchy", max_nfev=40)
        fits.append((result.cost, problem, x))
    _, problem, x = min(fits, key=lambda fit: fit[0])
    x, variance, weight, jacobian = problem.fit(x, free, np.arange(len(detected)), 20)
    _check(jacobian, variance, free)
    sigma, errors_m, errors_rad = _jackknife(problem, x, free, len(detected))
    X, Y = problem.transforms(x)
    nearest = np.argmin(rotation_angle_rad(Y.rotation @ turns))
    Y = Pose(Y.rotation @ turns[nearest], Y.position_m)
    return HandEye(X, Y, float(np.exp(x[12])), float(x[13]), sigma, weight > 0, errors_m, errors_rad)


def _check(jacobian, variance: float, free) -> None:
    """Raise ValueError if the detections do not decide a transform."""
    values, vectors = np.linalg.eigh(jacobian.T @ jacobian / variance)
    sigma = np.zeros(14)
    sigma[free] = np.sqrt((vectors**2 / np.maximum(values, 1e-12)).sum(1))
    if (sigma[:12].reshape(2, 2, 3).max(-1) > [MOST_M, MOST_RAD]).any():
        raise ValueError("the arm turns and moves too little to calibrate with; "
                         "record it turning about two axes at least")  # fmt: skip


def _jackknife(problem: _Problem, x, free, count: int):
    """Standard deviations (14,), and each detection's errors (N,) m and rad under a fit without its block."""
    fits, errors_m, errors_rad = [], np.empty(count), np.empty(count)
    for block in np.array_split(np.arange(count), BLOCKS):
        others = np.setdiff1d(np.arange(count), block)
        fits.append(problem.fit(x, free, others, 1)[0])
        for out, error in zip((errors_m, errors_rad), problem.errors(fits[-1], block), strict=True):
            out[block] = np.linalg.norm(error, axis=-1)
    fits = np.array(fits)
    spread = np.sum((fits - fits.mean(0)) ** 2, 0)
    return np.sqrt((BLOCKS - 1) / BLOCKS * spread), errors_m, errors_rad


def rotation_vector(R) -> np.ndarray:
    """Rotation vectors (..., 3) of matrices (..., 3, 3): axis times angle; zero at exactly half a turn."""
    sine = (R - np.swapaxes(R, -1, -2))[..., [2, 0, 1], [1, 2, 0]] / 2
    length = np.linalg.norm(sine, axis=-1)
    angle = np.arctan2(length, (np.trace(R, axis1=-2, axis2=-1) - 1) / 2)
    return sine * (angle / np.maximum(length, 1e-12))[..., None]
