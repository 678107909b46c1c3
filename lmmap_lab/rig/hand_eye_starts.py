"""Where the fit of `hand_eye` starts: linear solutions of its equation over all rotations of the camera."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from lmmap.geometry.rotations import rotation_z
from lmmap.types import Pose

SIGMA_M, SIGMA_RAD = 0.004, np.deg2rad(2.0)  # of a detection without a covariance; the fit rescales it
ROTATIONS = 1500  # a cover of all rotations


def starting_points(detected: Pose, T_root_tip: Pose, turns, T_cam_root: Pose | None, most: int = 4) -> list:
    """The likeliest ``(T_cam_root, T_tip_port, scale)``, over rotations that cover all of T_cam_root.

    Positions and normals alone rank the rotations, as yaw is ambiguous.
    """
    if T_cam_root is None:
        rotations = Rotation.random(ROTATIONS, rng=np.random.default_rng(0)).as_matrix()
    else:
        rotations = T_cam_root.rotation[None]
    unknowns, missed_m = _fit_positions(rotations, detected.position_m, T_root_tip)
    normals, tilt_rad = _fit_normals(rotations, detected.normal, T_root_tip)
    cost = np.median(missed_m, 1) / SIGMA_M + np.median(tilt_rad, 1) / SIGMA_RAD
    cost[unknowns[:, 6] <= 0.1] = np.inf
    starts = []
    for g in np.argsort(cost)[:most]:
        R, (t_tip_port, offset, (scale,)) = rotations[g], np.split(unknowns[g], [3, 6])
        T_tip_port = Pose(_fit_yaw(R, normals[g], detected, T_root_tip, len(turns)), t_tip_port)
        starts.append((Pose(R, R @ offset), T_tip_port, float(np.clip(scale, 0.2, 5))))
    return starts


def _fit_positions(rotations, position_m, T_root_tip: Pose):
    """For each rotation R (G, 3, 3) of T_cam_root, least squares in what positions depend on linearly:

        s R' p_i - A_i t_tip_port - R' t_cam_root = a_i

    with ``p_i`` the detected positions (N, 3) and ``A_i, a_i`` rotation and position of T_root_tip.  Returns
    ``(t_tip_port, R' t_cam_root, s)`` (G, 7) and the distances (G, N) that remain.
    """
    A, a = T_root_tip.rotation, T_root_tip.position_m
    G, N = len(rotations), len(a)
    turned = np.einsum("gji,nj->gni", rotations, position_m)
    fixed = np.concatenate([-A, -np.broadcast_to(np.eye(3), (N, 3, 3))], -1)
    fixed = np.broadcast_to(fixed, (G, N, 3, 6))
    system = np.concatenate([fixed, turned[..., None]], -1).reshape(G, 3 * N, 7)
    normal = np.swapaxes(system, 1, 2) @ system
    ridge = 1e-9 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(7)
    unknowns = np.linalg.solve(normal + ridge, (a.ravel() @ system)[..., None])[..., 0]
    missed = (system @ unknowns[..., None])[..., 0].reshape(-1, N, 3) - a
    return unknowns, np.linalg.norm(missed, axis=-1)


def _fit_normals(rotations, normal, T_root_tip: Pose):
    """The port's normal in the tip's frame for each rotation R (G, 3, 3) of T_cam_root: the mean (G, 3) of
    ``A_i' R' n_i``, and the angles (G, N) rad of the single ones to it."""
    in_root = np.einsum("gkj,nk->gnj", rotations, normal)
    in_tip = np.einsum("nji,gnj->gni", T_root_tip.rotation, in_root)
    mean = in_tip.mean(1)
    mean = mean / np.linalg.norm(mean, axis=-1, keepdims=True)
    return mean, np.arccos(np.clip(np.einsum("gni,gi->gn", in_tip, mean), -1, 1))


def _fit_yaw(R_cam_root, normal, detected: Pose, T_root_tip: Pose, symmetry: int) -> np.ndarray:
    """Rotation (3, 3) of T_tip_port with this normal: the circular mean of yaw modulo its period."""
    x_axis = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    x_axis = x_axis / np.linalg.norm(x_axis)
    frame = np.stack([x_axis, np.cross(normal, x_axis), normal], -1)
    spin = frame.T @ np.swapaxes(T_root_tip.rotation, -1, -2) @ R_cam_root.T @ detected.rotation
    yaw = symmetry * np.arctan2(spin[:, 1, 0] - spin[:, 0, 1], spin[:, 0, 0] + spin[:, 1, 1])
    return frame @ rotation_z(np.angle(np.exp(1j * yaw).sum()) / symmetry)
