"""The relative error of trajectories, which needs no common frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lmmap.geometry.rotations import rotation_angle_rad
from lmmap.types import Pose, Trajectory


def umeyama(source, target) -> tuple[float, np.ndarray, np.ndarray]:
    """Scale s, rotation R and translation t that minimise |target - (s R source + t)|^2 over points
    (M, 3) (Umeyama 1991).

    Raises
    ------
    ValueError
        If the points are fewer than three or lie on one line: their rotation is not determined.
    """
    source, target = np.asarray(source, float), np.asarray(target, float)
    if source.shape != target.shape or source.ndim != 2 or len(source) < 3:
        got = f"{source.shape}, {target.shape}"
        raise ValueError(f"source, target: expected equal shapes (M >= 3, 3), got {got}")
    mean_s, mean_t = source.mean(0), target.mean(0)
    U, D, Vt = np.linalg.svd((target - mean_t).T @ (source - mean_s) / len(source))
    if D[1] <= 1e-12 * max(D[0], 1e-300):
        raise ValueError("source, target: expected points that span a plane, got points on a line")
    S = np.diag([1, 1, np.sign(np.linalg.det(U) * np.linalg.det(Vt))])
    R = U @ S @ Vt
    s = float(np.trace(np.diag(D) @ S) / np.mean(np.sum((source - mean_s) ** 2, 1)))
    return s, R, mean_t - s * R @ mean_s


def associate(t_us, reference_t_us, max_gap_us: int = 20_000) -> tuple[np.ndarray, np.ndarray]:
    """Indices of times and reference times that are each other's nearest within ``max_gap_us``."""
    t, r = np.asarray(t_us, np.int64), np.asarray(reference_t_us, np.int64)
    if not (t.size and r.size):
        return np.zeros(0, np.intp), np.zeros(0, np.intp)
    to_r, to_t = _nearest(t, r), _nearest(r, t)
    i = np.nonzero((to_t[to_r] == np.arange(len(t))) & (np.abs(r[to_r] - t) <= max_gap_us))[0]
    return i, to_r[i]


def _nearest(values, grid):
    right = np.searchsorted(grid, values).clip(1, max(len(grid) - 1, 1))
    left = right - 1
    right = right.clip(max=len(grid) - 1)
    return np.where(np.abs(grid[right] - values) < np.abs(grid[left] - values), right, left)


@dataclass(frozen=True)
class RelativeError:
    """Errors over all stretches of one path length."""

    length_m: float
    translation_m: np.ndarray
    rotation_rad: np.ndarray


def relative_errors(
    estimate: Trajectory,
    reference: Trajectory,
    lengths_m: Sequence[float],
    *,
    align_scale: bool = True,
    aligned_poses: int = 40,
    tolerance: float = 0.2,
    max_gap_us: int = 20_000,
) -> list[RelativeError]:
    """Relative trajectory error (Zhang & Scaramuzza 2018), for each path length.

    Poses are those of the camera in a fixed frame, T_port_cam, the inverse of the trajectories'.
    For each pose i of the associated reference the pose j whose path length from i is nearest to L
    counts if it is within ``tolerance`` L, and with it the error

        E = (T_gt,i^-1 T_gt,j)^-1 (T_es,i^-1 T_es,j).

    With ``align_scale`` the estimate's positions are scaled first by the scale of the similarity
    (`umeyama`) of the first ``aligned_poses`` positions; its rotation and translation cancel in E.
    The definition is applied to every i; the published script skips some after a gap.

    Raises
    ------
    ValueError
        If fewer than two poses match, or too few to determine the scale.
    """
    i, j = associate(estimate.t_us, reference.t_us, max_gap_us)
    if len(i) < 2:
        raise ValueError(f"estimate: expected at least 2 poses near the reference's times, got {len(i)}")
    es, gt = estimate.poses[i].inverse, reference.poses[j].inverse
    if align_scale:
        s = umeyama(es.position_m[:aligned_poses], gt.position_m[:aligned_poses])[0]
        es = Pose(es.rotation, s * es.position_m)
    steps = np.linalg.norm(np.diff(gt.position_m, axis=0), axis=1)
    path = np.concatenate([[0.0], np.cumsum(steps)])
    return [_relative_error(es, gt, path, length, tolerance) for length in lengths_m]


def _relative_error(es: Pose, gt: Pose, path, length_m: float, tolerance: float) -> RelativeError:
    if not length_m > 0:
        raise ValueError(f"lengths_m: expected positive lengths, got {length_m}")
    i = np.arange(len(path))
    j = np.maximum(_nearest(path + length_m, path), i)
    kept = np.abs(path[j] - path - length_m) <= tolerance * length_m
    i, j = i[kept], j[kept]
    E = (gt[i].inverse @ gt[j]).inverse @ (es[i].inverse @ es[j])
    return RelativeError(length_m, np.linalg.norm(E.position_m, axis=-1), rotation_angle_rad(E.rotation))
