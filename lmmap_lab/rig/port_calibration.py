"""A port's dimensions from many images at once: one pose an image, and a geometry that all share.

Edges of ring and markers are measured across their projected outlines, and Gauss-Newton adjusts poses and
dimensions to them.  One camera cannot see how large everything is, so the radius of the ring's centre line
stays as given.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from lmmap.geometry.projection import project
from lmmap.types import Camera, Port, Pose

from .port_outline import KINDS, dimensions_m, kinds_of, outline, with_dimensions
from .port_statistics import covariance, solve, weights

# of what all images share
SIZES, OFFSETS, MASKS, LENS = slice(0, 5), slice(5, 7), slice(5, 9), slice(9, None)

PRIOR_SHARE = 0.2  # standard deviation of a dimension, in units of it, before anything is measured
OFFSET_PX = 0.3  # standard deviation of how far a mask reaches beyond its part, on all sides alike
GROWTH_PX = 0.15  # standard deviation of how much that changes while the distance grows e times
# standard deviations, before anything is measured, of the focal length's logarithm, the first radial
# coefficient, and the centre in units of the image's width
LENS_SIGMA = (0.5, 0.15, 0.01, 0.01)
ROUNDS, LEAST_ROUNDS, SETTLED = 40, 6, 0.03  # steps, and the last one's size in standard deviations
LONGEST_STEP, LONGEST_TURN_RAD = 0.2, 0.1  # in units of a dimension (px, logarithm), and of a pose
STEP_M = STEP = 1e-6  # for derivatives

Measure = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class PortFit:
    """What all images together say of a port.

    Attributes
    ----------
    port : Port
        The measured one.
    sigma_m : numpy.ndarray
        Standard deviations (5,) of `DIMENSIONS`.
    lens, lens_sigma : numpy.ndarray
        By what the lens differs from the camera's, as `with_lens` takes it, and the standard deviations,
        (0 to 4,).
    T_cam_port : Pose
        (N,) with the measured port.
    kept : numpy.ndarray
        Which images (N,) agree with it.
    offset_px : numpy.ndarray
        How far the masks of ring and markers reach beyond their edges, (2,).
    residual_px : numpy.ndarray
        Robust standard deviations (2,) of an edge of ring and markers.
    settled : bool
        Whether the last step was a small one.
    """

    port: Port
    sigma_m: np.ndarray
    lens: np.ndarray
    lens_sigma: np.ndarray
    T_cam_port: Pose
    kept: np.ndarray
    offset_px: np.ndarray
    residual_px: np.ndarray
    settled: bool

    @property
    def focal_ratio(self) -> float:
        """Of the focal length to the camera's."""
        return float(np.exp(self.lens[:1].sum()))

    @property
    def focal_ratio_sigma(self) -> float:
        return self.focal_ratio * float(self.lens_sigma[:1].sum())


def with_lens(camera: Camera, lens: np.ndarray) -> Camera:
    """A camera whose focal length's logarithm, first radial coefficient and centre, in units of the image's
    width, differ by as much as ``lens`` (0 to 4,) states."""
    log_ratio, k1, right, down = np.append(lens, np.zeros(4 - len(lens)))
    distortion = np.append(camera.distortion, np.zeros(max(4 - len(camera.distortion), 0)))
    distortion[0] += k1
    return replace(
        camera, fx_px=camera.fx_px * np.exp(log_ratio), fy_px=camera.fy_px * np.exp(log_ratio),
        cx_px=camera.cx_px + right * camera.width_px, cy_px=camera.cy_px + down * camera.width_px,
        distortion=tuple(distortion) if len(lens) > 1 else camera.distortion,
    )  # fmt: skip


def adjust(T_cam_port: Pose, measure: Measure, port: Port, camera: Camera, lens: int = 0,
           prior_m: np.ndarray | None = None) -> PortFit:  # fmt: skip
    """Poses and dimensions that fit the measured edges of all images best.

    Each step eliminates the poses (Schur complement), and edges are measured anew after it.  Tukey's weights
    doubt single edges.  An image with few edges, or residuals far beyond the others', takes no part.  Masks
    reach beyond their parts on all sides alike: how far, and how that changes with the distance, are unknowns
    of ring and markers each.

    Parameters
    ----------
    T_cam_port : (N,)
        Starts.
    measure
        From points (N, K, 2) px on the projected `outline`, and normals (N, K, 2) outward there, to the gaps
        (N, K) px along the normals to the image's edges; NaN where there is none.
    port
        The start; what is not measured stays as it has it.
    lens
        How many values of `with_lens` are unknown, too: 1 is the focal length alone.
    prior_m
        Standard deviations (5,) of `DIMENSIONS` before anything is measured; default: a fifth of each.
    """
    dimensions, extra = dimensions_m(port), np.array(LENS_SIGMA[:lens])
    start = np.concatenate([dimensions, np.zeros(2 * KINDS), 0 * extra])
    size = np.maximum(np.abs(dimensions), 0.1 * port.ring_radius_m)  # a plate may stand in the ring's plane
    prior_m = PRIOR_SHARE * size if prior_m is None else prior_m
    prior = [prior_m, np.repeat([OFFSET_PX, GROWTH_PX], KINDS), extra]
    precision = np.diag(np.concatenate(prior) ** -2.0)
    longest = LONGEST_STEP * np.concatenate([size, np.ones(2 * KINDS + lens)])
    T, shared, settled, kept_before = T_cam_port, start, False, np.ones(len(T_cam_port), bool)
    for count in range(ROUNDS):
        gap_px, J_pose, J_shared = linearise(T, shared, measure, port, camera)
        residual = gap_px - J_shared[..., MASKS] @ shared[MASKS]
        weight, bend, residual_px, kept = weights(residual)
        kept &= kept_before | (count < ROUNDS // 2)  # late, none comes back: it might go and come for ever
        kept_before = kept

        # an image has [A B; B' C] [pose; shared] = [a; c], without its pose (C - B' A^-1 B) shared = score
        r = np.where(weight > 0, residual, 0)[..., None]
        J_pose_w, J_shared_w = (np.swapaxes(J * weight[..., None], -1, -2) for J in (J_pose, J_shared))
        A = J_pose_w @ J_pose + 1e-3 * np.eye(6)  # an image without edges stays where it is
        by_shared, by_edges = np.split(
            np.linalg.solve(A, J_pose_w @ np.concatenate([J_shared, r], -1)), [-1], -1
        )
        free = J_shared - J_pose @ by_shared
        S = (J_shared_w @ free)[kept].sum(0) + precision
        score = (np.swapaxes(free * weight[..., None], -1, -2) @ r)[kept, :, 0]

        step = solve(S, score.sum(0) + precision @ (start - shared))
        step = step * min(1.0, np.min(longest / np.maximum(np.abs(step), 1e-30)))
        shared = shared + step
        shared[1:5] = np.clip(shared[1:5], 0.1 * dimensions[1:], 5 * dimensions[1:])  # lengths
        T = _moved(T, by_edges[..., 0] - by_shared @ step)
        sigma = np.sqrt(covariance(S, score, precision, bend).diagonal())
        settled = bool(np.all(np.abs(step) < SETTLED * sigma))
        if settled and count + 1 >= LEAST_ROUNDS:
            break
    return PortFit(with_dimensions(port, shared[SIZES]), sigma[SIZES], shared[LENS], sigma[LENS], T, kept,
                   shared[OFFSETS], residual_px, settled)  # fmt: skip


def linearise(T: Pose, shared, measure: Measure, port: Port, camera: Camera):
    """Measured gaps (N, K) px at poses (N,), and their derivatives by what would close them: by the poses
    (N, K, 6) and by what all images share (N, K, Q)."""
    sizes, lens, assumed = shared[SIZES], shared[LENS], camera
    camera = with_lens(assumed, lens)
    now = outline(with_dimensions(port, sizes))
    turned, along, outward = (v @ np.swapaxes(T.rotation, -1, -2) for v in now)
    in_cam = turned + T.position_m[:, None]  # (N, K, 3)
    at = project(in_cam, camera)
    by_point = np.stack([project(in_cam + d, camera) - project(in_cam - d, camera)
                         for d in STEP_M * np.eye(3)], -1) / (2 * STEP_M)  # fmt: skip
    u, v = np.moveaxis((by_point @ along[..., None])[..., 0], -1, 0)
    normal = np.stack([v, -u], -1)
    normal *= np.sign(np.sum(normal * (by_point @ outward[..., None])[..., 0], -1, keepdims=True))
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
    gap_px = np.where(np.isfinite(at).all(-1), measure(at, normal), np.nan)

    across = (normal[..., None, :] @ by_point)[..., 0, :]  # n' dp, (N, K, 3)
    J_pose = np.concatenate([across, np.cross(turned, across)], -1)  # n' (w x R X) = w' (R X x n)
    by_size = np.stack([outline(with_dimensions(port, sizes + d)).points_m - now.points_m
                        for d in STEP_M * np.eye(len(sizes))], -1) / STEP_M  # fmt: skip
    log_distance = np.log(np.linalg.norm(T.position_m, axis=-1))
    mask = np.broadcast_to(np.eye(KINDS)[kinds_of(len(by_size))], (*at.shape[:2], KINDS))
    J = [np.einsum("nkj,nji,kid->nkd", across, T.rotation, by_size), mask,
         mask * (log_distance - np.median(log_distance))[:, None, None]]  # fmt: skip
    for step in STEP * np.eye(len(lens)):
        ahead, behind = (project(in_cam, with_lens(assumed, lens + d)) for d in (step, -step))
        J.append(np.sum(normal * (ahead - behind), -1, keepdims=True) / (2 * STEP))
    return gap_px, np.nan_to_num(J_pose), np.nan_to_num(np.concatenate(J, -1))


def _moved(T: Pose, step) -> Pose:
    """Poses (N,) after steps (N, 6) m and rad, which are cut where they turn too far."""
    angle_rad = np.linalg.norm(step[:, 3:], axis=1, keepdims=True)
    step = step * np.minimum(1.0, LONGEST_TURN_RAD / np.maximum(angle_rad, 1e-12))
    return Pose(Rotation.from_rotvec(step[:, 3:]).as_matrix() @ T.rotation, T.position_m + step[:, :3])
