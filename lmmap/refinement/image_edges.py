"""Refine a pose on the image's own edges instead of the networks' masks.

The outline is the ring's two edges, the plate's rim and the petals' tips.  Along each point's normal, the
strongest edge nearby is sought, and Gauss-Newton steps move the outline there, with the previous pose and its
covariance as a prior.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ..geometry.compiled import njit
from ..geometry.port import circle_points_m
from ..geometry.projection import project_points
from ..geometry.rotations import move, rotation_z, step_between
from ..geometry.sampling import profiles
from ..settings import OURS, Settings
from ..types import Camera, Port, Pose, frozen_array
from .joint import across_by_pose, move_by_each_step
from .verify import hidden

RING_POINTS, SIDE_POINTS = 48, 6  # of each of the ring's edges, and of each side of the rim or tip
OUTWARD_M = 0.001  # from a point of the outline to the one beside it
PROFILE_STEP_PX = 0.5


def refine(
    T_cam_port: Pose, higher: float, covariance, strength, port: Port, camera: Camera,
    settings: Settings = OURS,
) -> tuple[Pose, float, np.ndarray]:  # fmt: skip
    """Refine a pose and the plate's excess height, in tolerances, on the edges; return both with their
    covariance (7, 7).

    Parameters
    ----------
    higher, covariance : float, (7, 7)
        The plate's height and the covariance before, conventions of `JointFit`.
    strength : (H, W)
        Edges of the image, in units of those around them (`outline.edges`).

    Notes
    -----
    Lens and glare make parts look wider or narrower than they are, so the outward offset of the ring's edges
    and that of the plate's are two more unknowns.  An edge `edge_reach_px` away has no influence.  With too
    few edges (`min_edges`) the pose stays as it is.
    """
    points_m, outward_m, on_ring = _outline(port)
    rise_m = port.plate_height_tolerance * port.plate_height_m * np.array([0, 0, 1.0]) * ~on_ring[:, None]
    information = np.zeros((9, 9))
    information[:7, :7] = np.linalg.inv(covariance)
    information[7:, 7:] = np.eye(2) / settings.edge_offset_px**2
    all_m = np.stack([points_m, outward_m, points_m + rise_m])
    T, rest, sigma_px = T_cam_port, np.array([higher, 0.0, 0.0]), settings.edge_sigma_px
    for _ in range(settings.edge_rounds):
        at, beside, above = project_points(T, all_m, camera)
        normal = (beside - at) / np.maximum(np.linalg.norm(beside - at, axis=1, keepdims=True), 1e-9)
        gap_px, seen = _gaps(strength, at, normal, settings)
        seen[on_ring] &= ~hidden(points_m[on_ring], T.inverse.position_m, port)
        if seen.sum() < settings.min_edges:
            return T_cam_port, higher, np.asarray(covariance)
        by_pose = across_by_pose(move_by_each_step(T), points_m[seen], normal[seen], camera)
        risen = np.sum((above - at) * normal, -1)[seen]
        J = np.column_stack([by_pose, risen, on_ring[seen], ~on_ring[seen]])
        residual = gap_px[seen] - J[:, 6:] @ rest
        weight = (1 + (residual / (settings.edge_outlier_sigmas * sigma_px)) ** 2) ** -2.0 / sigma_px**2
        away = np.concatenate([step_between(T_cam_port, T), rest - [higher, 0, 0]])
        normal_matrix = (J.T * weight) @ J + information
        step = np.linalg.solve(normal_matrix, (J.T * weight) @ residual - information @ away)
        T, rest = move(T, step[:6]), rest + step[6:]
    return T, float(rest[0]), np.linalg.inv(normal_matrix)[:7, :7]


def _gaps(strength, at, normal, settings: Settings) -> tuple[np.ndarray, np.ndarray]:
    """How far outward (N,) px the strongest edge is from points (N, 2), nearer ones first, and whether it
    stands out (N,)."""
    reach_px = settings.edge_reach_px
    offsets_px = np.arange(-reach_px, reach_px + PROFILE_STEP_PX / 2, PROFILE_STEP_PX)
    fade = np.exp(-0.5 * (offsets_px / (0.6 * reach_px)) ** 2)
    steps, height = _highest(profiles(strength, at, normal, offsets_px), fade)
    return steps * PROFILE_STEP_PX - reach_px, height > settings.edge_least


@njit(nogil=True, error_model="numpy")
def _highest(profile, fade):
    """Where profiles (N, K) times a fade (K,) are highest, by a parabola, (N,) in steps from their first
    value; and how high, 0 where that is at an end."""
    steps, height = np.zeros(len(profile)), np.zeros(len(profile))
    for i in range(len(profile)):
        faded = profile[i] * fade
        k = faded.argmax()
        if 0 < k < len(fade) - 1:
            left, top, right = faded[k - 1], faded[k], faded[k + 1]
            shift = 0.5 * (right - left) / max(2 * top - left - right, 1e-9)
            steps[i], height[i] = k + min(max(shift, -1.0), 1.0), top
    return steps, height


@lru_cache
def _outline(port: Port) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points (N, 3) of ring, rim and tips, a point beside each outward, and which are of the ring (N,)."""
    radii_m = port.ring_inner_radius_m, port.ring_outer_radius_m
    inner, outer = (circle_points_m(radius_m, RING_POINTS) for radius_m in radii_m)
    radial = circle_points_m(OUTWARD_M, RING_POINTS)
    share = (np.arange(SIDE_POINTS) + 1) / (SIDE_POINTS + 1) - 0.5
    points_m, beside_m = [inner, outer], [inner - radial, outer + radial]
    tip_m, height_m = port.apothem_m + port.petal_lean_m, port.plate_height_m + port.petal_rise_m
    sides = [(port.apothem_m, port.plate_circumradius_m, port.plate_height_m)] * (2 * port.symmetry)
    yaws: list[float] = [*(np.arange(2 * port.symmetry) / 2), *range(port.symmetry)]
    sides += [(tip_m, port.petal_widths_m[1], height_m)] * port.symmetry
    for (away_m, width_m, z_m), k in zip(sides, yaws, strict=True):
        turn = rotation_z(np.array(k * port.yaw_period_rad))
        side = np.stack([np.full_like(share, away_m), share * width_m, np.full_like(share, z_m)], -1)
        points_m.append(side @ turn.T)
        beside_m.append((side + np.array([OUTWARD_M, 0, 0])) @ turn.T)
    on_ring = np.repeat([True, False], [2 * RING_POINTS, len(sides) * SIDE_POINTS])
    points, beside = (frozen_array(np.concatenate(part)) for part in (points_m, beside_m))
    return points, beside, frozen_array(on_ring, bool)
