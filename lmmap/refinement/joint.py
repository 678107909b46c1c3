"""Joint refinement of a pose against both masks: the ring's contour and the markers' edges.

The ring alone fixes five degrees of freedom, but seen head-on its tilt only poorly.  The markers stand above
its plane, so a rotation shifts them against the ring: their edges add what the ring lacks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ..geometry.conic_fit import sampson_distance
from ..geometry.conics import circle_conic, conic_coefficients
from ..geometry.projection import project_points
from ..geometry.robust import median, tukey_cut, tukey_weights
from ..geometry.rotations import move, single_rotation_matrix
from ..geometry.sampling import profiles
from ..settings import OURS, Settings
from ..types import Camera, Port, Pose, frozen_array

POINTS_PER_SIDE = 10  # of a marker, in the order of `_side_points_m`
STEPS = np.diag([1e-6] * 3 + [1e-6] * 3)  # m, rad: for derivatives
PRIOR = np.diag([0.0] * 6 + [1.0] * 3 + [0.0])  # of pose; height, radius, width (tolerances); growth
_SHIFTS_M = np.vstack([np.zeros(3), STEPS[:, :3]])
_TURNS = np.stack([np.eye(3), *map(single_rotation_matrix, STEPS[:, 3:])])


class RingEdge(NamedTuple):
    """Undistorted points (M, 2) of an edge of the ring, the standard deviation (M,) of each, the edge's
    radius and its side: -1 for the inner edge, 1 for the outer one, 0 for a centre line."""

    points_px: np.ndarray
    sigma_px: np.ndarray
    radius_m: float
    side: int


@dataclass(frozen=True)
class JointFit:
    """The refined pose; how far the plate's height and the markers' radius deviate, in units of their
    tolerances (2,); the covariance (7, 7) of pose (conventions of `uncertainty`) and height; and the number
    of the markers' edge points that were used."""

    T_cam_port: Pose
    port_off: np.ndarray
    covariance: np.ndarray
    edges: int


def refine(T_cam_port: Pose, ring: Sequence[RingEdge], reflector_mask, port: Port, camera: Camera,
           marker_sigma_px: float, settings: Settings = OURS) -> JointFit | None:  # fmt: skip
    """Refine a pose by Gauss-Newton on the ring's edges and the markers' edge points, each in units of its
    own standard deviation; return None if too few edges of markers are seen to add anything.

    Edges are measured across the projected sides of the markers, with Tukey's weights.  Further unknowns
    are the plate's height, the markers' radius and the ring's width within the port's tolerances, and by how
    much the markers' mask is wider or narrower than the markers, equally on all sides.
    """
    mask = np.ascontiguousarray(reflector_mask, np.float32)
    sides_m = _side_points_m(port)
    T = T_cam_port
    for _ in range(settings.joint_rounds):
        edges = _measure_edges(mask, T, sides_m, camera, settings)
        if edges is None:
            return None
        moved_m, normal, gap_px = edges
        steps = move_by_each_step(T)
        J_edge = np.zeros((len(gap_px), 10))
        J_edge[:, :6] = across_by_pose(steps, moved_m[0], normal, camera)
        at, *there = project_points(T, moved_m, camera)
        J_edge[:, 6:8] = np.sum((there - at) * normal, -1).T
        J_edge[:, 9] = 1
        centred = gap_px - median(gap_px)
        weight = tukey_weights(centred, tukey_cut(centred, least_sigma=0.3))

        # Gauss-Newton: (J' W J) step = J' W r, solved with unit diagonal and a ridge of 1e-9
        rows = _ring_rows(steps, ring, port, camera)
        of_markers = J_edge / marker_sigma_px, -gap_px / marker_sigma_px
        J, r = map(np.concatenate, zip(*rows, of_markers, strict=True))
        w = np.append(np.ones(len(r) - len(weight)), weight)
        normal_matrix = (J.T * w) @ J + PRIOR
        scale = np.sqrt(np.maximum(normal_matrix.diagonal(), 1e-12))
        scaled = normal_matrix / np.outer(scale, scale) + 1e-9 * np.eye(len(scale))
        step = np.linalg.solve(scaled, (J.T @ (w * r)) / scale) / scale
        T = move(T, -step[:6])
        if np.sum(w * (J[:, :6] @ step[:6]) ** 2) < settings.joint_settled**2:
            break
    inverse = np.linalg.inv(scaled) / np.outer(scale, scale)
    sane = np.all(np.isfinite(T.position_m)) and T.normal @ T_cam_port.normal > 0.9
    return JointFit(T, -step[6:8], inverse[:7, :7], len(gap_px)) if sane else None


def _ring_rows(steps: Pose, ring: Sequence[RingEdge], port: Port, camera: Camera):
    """Derivatives (M, 10) and residuals (M,) of each edge's points, in standard deviations."""
    radii_m = [edge.radius_m for edge in ring]
    thetas = conic_coefficients(circle_conic(steps[:, None], radii_m, camera))
    wider_m = port.ring_width_tolerance * (port.ring_outer_radius_m - port.ring_inner_radius_m) / 2
    wider_px = wider_m * camera.fx_px / steps.position_m[0, 2]
    for edge, theta in zip(ring, np.swapaxes(thetas, 0, 1), strict=True):
        distance = sampson_distance(theta, edge.points_px)  # (7, M)
        J = np.zeros((len(edge.points_px), 10))
        J[:, :6] = (distance[1:] - distance[0]).T / STEPS.diagonal()
        J[:, 8] = -edge.side * wider_px
        yield J / edge.sigma_px[:, None], distance[0] / edge.sigma_px


def markers_off_px(T_cam_port: Pose, port_off, port: Port, camera: Camera) -> float:
    """Root-mean-square distance (px) at a pose between the markers and where the port's geometry puts them,
    if its height and radius deviate by ``port_off`` (2,) tolerances."""
    moved_m, _ = _side_points_m(port)
    off_m = np.tensordot(port_off, moved_m[1:] - moved_m[0], 1)
    at, there = project_points(T_cam_port, np.stack([moved_m[0], moved_m[0] + off_m]), camera)
    return float(np.sqrt(np.mean(np.sum((there - at) ** 2, -1))))


def inflate(covariance, marker_score, inflation: float = 1.0, fading: float = 2.0) -> np.ndarray:
    """Scale a covariance (..., N, N) by ``inflation`` at a markers' score (...) of 1, and by more if the
    markers are faint: as 1 / score to the power ``fading``.  On masks, a standard deviation scales as
    1 / score."""
    return np.asarray(covariance) * (inflation / np.power(marker_score, fading))[..., None, None]


def move_by_each_step(T: Pose) -> Pose:
    """A pose and the same pose moved by each of `STEPS`, shape (7,)."""
    return Pose(_TURNS @ T.rotation, T.position_m + _SHIFTS_M)


def across_by_pose(steps: Pose, points_m, normal, camera: Camera) -> np.ndarray:
    """Derivatives (N, 6) of points (N, 3) of the port along image normals (N, 2), by `move_by_each_step`."""
    seen = project_points(steps, points_m, camera)
    return np.einsum("kni,ni->nk", seen[1:] - seen[0], normal) / STEPS.diagonal()


@lru_cache
def _side_points_m(port: Port):
    """Points on the markers' sides without their corners, as the port has them and with plate and markers
    moved by a tolerance each, (3, P, 3); and beside each a point outward, (P, 3)."""
    corners = port.marker_corners_m()
    following = np.roll(corners, -1, 1)
    s = (np.arange(POINTS_PER_SIDE) + 1.5) / (POINTS_PER_SIDE + 2)
    points = corners[:, :, None] + s[:, None] * (following - corners)[:, :, None]
    middle = corners.mean(1, keepdims=True)
    beside = points + 0.05 * ((corners + following) / 2 - middle)[:, :, None]
    higher = port.plate_height_tolerance * port.plate_height_m * np.array([0, 0, 1.0])
    further = port.marker_radius_tolerance * middle[:, :, None] * [1, 1, 0]
    moved = np.stack([points, points + higher, points + further])
    return frozen_array(moved.reshape(3, -1, 3)), frozen_array(beside.reshape(-1, 3))


def _measure_edges(mask, T: Pose, sides_m, camera: Camera, settings: Settings):
    """Where the mask's edges are seen: points (3, K, 3) m, outward image normals (K, 2), gaps (K,) px from
    the projected sides outward to the mask's edges; None if there are too few.

    The gap is the integral of the profile across the side, less its inner half.
    """
    moved_m, beside_m = sides_m
    at, beside = project_points(T, np.stack([moved_m[0], beside_m]), camera)
    steps = np.diff(at.reshape(-1, POINTS_PER_SIDE, 2), axis=1)  # to the next point of the same side
    along = np.concatenate([steps, steps[:, -1:]], 1).reshape(-1, 2)  # the last point has the step before it
    normal = np.stack([along[:, 1], -along[:, 0]], -1)
    normal *= np.sign(np.sum(normal * (beside - at), -1, keepdims=True))
    normal /= np.maximum(np.sqrt(np.sum(normal * normal, -1, keepdims=True)), 1e-12)
    half_px = settings.edge_half_px
    offsets = np.arange(-half_px, half_px + 0.25, 0.5)
    profile = profiles(mask, at, normal, offsets)
    inner, outer = profile[:, :3].sum(1) / 3, profile[:, -3:].sum(1) / 3
    contrast = inner - outer
    good = (contrast > settings.edge_contrast) & np.isfinite((at + normal).sum(1))
    if good.sum() < settings.min_edges:
        return None
    level = (profile[good] - outer[good, None]) / contrast[good, None]
    gap_px = (level.sum(1) - 0.5 * (level[:, 0] + level[:, -1])) * 0.5 - half_px
    return moved_m[:, good], normal[good], gap_px
