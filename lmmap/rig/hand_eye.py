"""Robot-world hand-eye calibration: where the camera and the port are on an arm, from detections.

An arm reports ``T_root_tip(t)``, its own motion between the end at the camera's side (``root``) and the end
at the port's (``tip``).  Camera and port are each fixed to one of them, and a detection sees

    T_cam_port(t) = T_cam_root  T_root_tip(t + delay)  T_tip_port

with positions divided by ``scale``, the true size of the ring over the assumed one (Zhuang, Roth &
Sudhakar 1994 for the equation; scale, delay and robust weights are ours).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from ..geometry.rotations import equal_turns, rotation_angle_rad, rotation_vector, rotation_z
from ..types import Pose, frozen_array
from .ur5e import ArmSamples

SIGMA_M, SIGMA_RAD = 0.004, np.deg2rad(2.0)  # of a detection, where it does not say; rescaled by the fit
FLOOR_M, FLOOR_RAD = 0.0005, np.deg2rad(0.2)  # no detection is known better, whatever its covariance
GUESSES, SUBSET, BLOCKS = 1500, 80, 10
CUT = chi2.ppf(0.999, 6)  # squared distance, in standard deviations, from which a detection has no weight
MOST_M, MOST_RAD = 0.05, np.deg2rad(5.0)  # a transform known worse than this is not known
PRIOR = np.array([0.5, 0.1])  # of log(scale) and delay (s): so wide that it counts where nothing else does


@dataclass(frozen=True)
class HandEye:
    """A calibration.  ``sigma`` (14,): standard deviations of T_cam_root (m, rad), T_tip_port (m, rad),
    log(scale) and delay (s); ``errors_m, errors_rad`` (N,): of each detection against a fit that has not
    seen its stretch of time; ``kept`` (N,): which detections had weight."""

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
    """Detections and arm, and the residuals (N, 6) of parameters (14,) about a pair of transforms."""

    def __init__(self, detected: Pose, arm: ArmSamples, whitener, turns, X: Pose, Y: Pose):
        self.detected, self.arm, self.whitener, self.turns = detected, arm, whitener, turns
        self.X, self.Y = X, Y

    def transforms(self, x) -> tuple[Pose, Pose]:
        return _moved(self.X, x[:6]), _moved(self.Y, x[6:12])

    def errors(self, x, rows=slice(None)):
        """Position (M, 3) m and rotation (M, 3) rad by which detections differ, in the camera's axes."""
        X, Y = self.transforms(x)
        T = X @ _moved(self.arm.T_root_tip[rows], self.arm.velocity[rows] * x[13]) @ Y
        seen = self.detected.rotation[rows, None] @ self.turns
        nearest = np.argmax(np.einsum("nkij,nij->nk", seen, T.rotation), 1)
        rotation = rotation_vector(seen[np.arange(len(seen)), nearest] @ np.swapaxes(T.rotation, -1, -2))
        return self.detected.position_m[rows] - T.position_m * np.exp(-x[12]), rotation

    def residuals(self, x, rows=slice(None)) -> np.ndarray:
        """Whitened, (M, 6)."""
        return np.einsum("nij,nj->ni", self.whitener[rows], np.hstack(self.errors(x, rows)))

    def least(self, x, free, rows, weight=1.0, variance: float = 1.0, **options):
        """Least squares over the entries ``free`` of ``x``, prior included: ``x``, and SciPy's result."""

        def put(values):
            y = x.copy()
            y[free] = values
            return y

        def stacked(values):
            y = put(values)
            prior = np.sqrt(variance) * y[12:] / PRIOR
            return np.concatenate([(weight * self.residuals(y, rows)).ravel(), prior])

        found = least_squares(stacked, x[free], x_scale="jac", **options)
        return put(found.x), found

    def fit(self, x, free, rows, rounds: int = 6):
        """Biweight fit from ``x``: the parameters, the variance, weights (M,), and the Jacobian."""
        for k in range(rounds):
            squared = np.sum(self.residuals(x, rows) ** 2, -1)
            variance = np.median(squared) / chi2.median(6)
            weight = np.clip(1 - squared / (variance * CUT), 0, None)  # its root is the residual's factor
            before, (x, found) = x, self.least(x, free, rows, weight[:, None], variance, max_nfev=8)
            if k and np.abs(x - before).max() < 1e-7:
                break
        return x, variance, weight, found.jac


def _moved(T: Pose, by) -> Pose:
    """Poses moved by (..., 6): shifted (m), and turned (rad) about their own origins in the root's axes."""
    return Pose(Rotation.from_rotvec(by[..., 3:]).as_matrix() @ T.rotation, T.position_m + by[..., :3])


def solve(detected: Pose, arm: ArmSamples, yaw_period_rad: float, covariance=None,
          T_cam_root: Pose | None = None) -> HandEye:  # fmt: skip
    """Calibrate from detections ``T_cam_port`` (N,) in the order of time, yaw modulo its period.

    Parameters
    ----------
    detected : (N,); outliers and flips of yaw are expected
    arm : at the detections' times by the camera's clock
    covariance : (N, 6, 6) of the detections as `Estimate` has it; default: all alike
    T_cam_root : where it is known; then only the rest is estimated

    Returns
    -------
    HandEye
        With yaw of ``T_tip_port`` chosen, of the equivalent ones, as the least turn.  Uncertainty and errors
        come from leaving out each of ten stretches of time in turn (a jackknife), as a detection's error
        resembles its neighbours'.

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
    free, tried = np.arange(6 if T_cam_root else 0, 14), []
    for X, Y, scale in _guesses(detected[subset], arm.T_root_tip[subset], turns, T_cam_root):
        problem = _Problem(detected, arm, whitener, turns, T_cam_root or X, Y)
        x = np.r_[np.zeros(12), np.log(scale), 0.0]
        x, first = problem.least(x, free, subset, loss="cauchy", max_nfev=40)
        tried.append((first.cost, problem, x))
    _, problem, x = min(tried, key=lambda one: one[0])
    x, variance, weight, jacobian = problem.fit(x, free, np.arange(len(detected)), 20)
    _check(jacobian, variance, free)
    sigma, errors_m, errors_rad = _jackknife(problem, x, free, len(detected))
    X, Y = problem.transforms(x)
    nearest = np.argmin(rotation_angle_rad(Y.rotation @ turns))
    Y = Pose(Y.rotation @ turns[nearest], Y.position_m)
    return HandEye(X, Y, float(np.exp(x[12])), float(x[13]), sigma, weight > 0, errors_m, errors_rad)


def _guesses(detected: Pose, A: Pose, turns, T_cam_root: Pose | None, most: int = 4) -> list:
    """The likeliest ``(T_cam_root, T_tip_port, scale)`` over a cover of all rotations of the first.

    Positions and normals alone decide, as yaw is ambiguous.  For a rotation R of T_cam_root, positions are
    linear in the rest, ``s R' p_i = A_i t_tip_port + u``; the normals R_A' R' n_i should all be one.
    """
    candidates = Rotation.random(GUESSES, rng=np.random.default_rng(0)).as_matrix()
    if T_cam_root is not None:
        candidates = T_cam_root.rotation[None]
    N, p = len(A), detected.position_m
    seen = np.einsum("gji,nj->gni", candidates, p)
    fixed = np.concatenate([-A.rotation, -np.broadcast_to(np.eye(3), (N, 3, 3))], -1)
    fixed = np.broadcast_to(fixed, (len(candidates), N, 3, 6))
    system = np.concatenate([fixed, seen[..., None]], -1).reshape(len(candidates), 3 * N, 7)
    normal = np.swapaxes(system, 1, 2) @ system
    ridge = 1e-9 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(7)
    unknown = np.linalg.solve(normal + ridge, (A.position_m.ravel() @ system)[..., None])[..., 0]
    missed = np.linalg.norm((system @ unknown[..., None])[..., 0].reshape(-1, N, 3) - A.position_m, axis=-1)
    in_tip = np.einsum("nji,gnj->gni", A.rotation, np.einsum("gkj,nk->gnj", candidates, detected.normal))
    mean = in_tip.mean(1)
    mean = mean / np.linalg.norm(mean, axis=-1, keepdims=True)
    tilt = np.arccos(np.clip(np.einsum("gni,gi->gn", in_tip, mean), -1, 1))
    cost = np.median(missed, 1) / SIGMA_M + np.median(tilt, 1) / SIGMA_RAD
    cost[unknown[:, 6] <= 0.1] = np.inf
    found = []
    for g in np.argsort(cost)[:most]:
        scale = float(np.clip(unknown[g, 6], 0.2, 5))
        x_axis = np.cross(mean[g], np.eye(3)[np.argmin(np.abs(mean[g]))])
        x_axis = x_axis / np.linalg.norm(x_axis)
        frame = np.stack([x_axis, np.cross(mean[g], x_axis), mean[g]], -1)
        spin = frame.T @ np.swapaxes(A.rotation, -1, -2) @ candidates[g].T @ detected.rotation
        yaw = len(turns) * np.arctan2(spin[:, 1, 0] - spin[:, 0, 1], spin[:, 0, 0] + spin[:, 1, 1])
        yaw = np.angle(np.exp(1j * yaw).sum()) / len(turns)
        T_tip_port = Pose(frame @ rotation_z(yaw), unknown[g, :3])
        found.append((Pose(candidates[g], candidates[g] @ unknown[g, 3:6]), T_tip_port, scale))
    return found


def _check(jacobian, variance: float, free) -> None:
    """ValueError where the detections leave a transform open."""
    values, vectors = np.linalg.eigh(jacobian.T @ jacobian / variance)
    sigma = np.zeros(14)
    sigma[free] = np.sqrt((vectors**2 / np.maximum(values, 1e-12)).sum(1))
    if (sigma[:12].reshape(2, 2, 3).max(-1) > [MOST_M, MOST_RAD]).any():
        raise ValueError("the arm turns and moves too little to calibrate with; "
                         "record it turning about two axes at least")  # fmt: skip


def _jackknife(problem: _Problem, x, free, count: int):
    """Standard deviations (14,), and each detection's errors (N,) m, rad, by fits without its block."""
    fits, errors_m, errors_rad = [], np.empty(count), np.empty(count)
    for block in np.array_split(np.arange(count), BLOCKS):
        others = np.setdiff1d(np.arange(count), block)
        fits.append(problem.fit(x, free, others, 1)[0])
        for out, error in zip((errors_m, errors_rad), problem.errors(fits[-1], block), strict=True):
            out[block] = np.linalg.norm(error, axis=-1)
    fits = np.array(fits)
    spread = np.sum((fits - fits.mean(0)) ** 2, 0)
    return np.sqrt((BLOCKS - 1) / BLOCKS * spread), errors_m, errors_rad
