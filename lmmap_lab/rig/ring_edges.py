"""The ring's own edges in a picture on which lines were drawn, and the pose that they show.

The edges are measured between the drawn pixels: where the brightness, along a normal of the expected ellipse,
crosses a level between the ring's and its surroundings'.  A bright stroke spreads, so both edges seem to lie
further from its middle than they do, and by how much is an unknown.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from lmmap.geometry.conics import circle_conic, circle_ellipse
from lmmap.geometry.sampling import sample
from lmmap.types import Camera, Port, Pose

ANGLES = 120  # places around the ring
STEP_PX = 0.1  # along a normal
NEAR_PX, FAR_PX = 2.5, 6.0  # of the edge: where the ring, and its surroundings, are read
LEAST_CONTRAST = 40.0  # grey levels between them
LEAST_EDGES = 30
REACHES_PX = (4.0, 2.5, 1.5)  # how far from the expected place an edge may be, round after round
LONGEST_GAP_PX = 3.0  # between shown places around a crossing: a line of one pixel hides three
ROBUST_PX = 0.5
OUTER, INNER = 1.0, -1.0  # to which side of an edge its surroundings are, from the ring's centre


@dataclass(frozen=True)
class Edges:
    """Points (K, 2) px of the edges that are seen, and of each its ``side``, `OUTER` or `INNER`, and its
    ``place`` around the ring, from 0 to `ANGLES`."""

    points_px: np.ndarray
    side: np.ndarray
    place: np.ndarray

    def __getitem__(self, index) -> Edges:
        return Edges(self.points_px[index], self.side[index], self.place[index])


def measured(grey, hidden, T_start: Pose, port: Port, camera: Camera, level: float = 0.5):
    """The `edges` of the ring, and their `pose_of`: measured anew around each pose that they show."""
    T, spread_px = T_start, 0.0
    for reach_px in REACHES_PX:
        seen = edges(grey, hidden, T, port, camera, level, spread_px, reach_px)
        if len(seen.side) < LEAST_EDGES:
            return seen, T_start, 0.0, np.empty(0)
        T, spread_px, left_px = pose_of(seen, T, port, camera)
    return seen, T, spread_px, left_px


def edges(grey, hidden, T_expected: Pose, port: Port, camera: Camera, level: float = 0.5,
          spread_px: float = 0.0, reach_px: float = REACHES_PX[0]) -> Edges:  # fmt: skip
    """Edges of the ring near its expected pose.

    Parameters
    ----------
    grey : (H, W)
        Brightness.
    hidden : (H, W) bool
        Pixels that something was drawn on, and those of glare.
    level
        Share of the contrast, from the surroundings to the ring, at which an edge is.
    spread_px
        How far the edges are expected outside the ring's own.
    reach_px
        How far from there they may be.
    """
    shown, found = np.float32(~np.asarray(hidden)), []
    grey = np.float32(grey)
    out_px = np.arange(-FAR_PX, FAR_PX + STEP_PX / 2, STEP_PX)
    for side, radius_m in ((OUTER, port.ring_outer_radius_m), (INNER, port.ring_inner_radius_m)):
        at, normal = _normals(T_expected, radius_m, camera)
        line = at[:, None] + side * (spread_px + out_px[:, None]) * normal[:, None]  # outward, (A, S, 2)
        bright = np.where(sample(shown, line) > 0.99, sample(grey, line), np.nan)
        for place, (profile, points) in enumerate(zip(bright, line, strict=True)):
            crossing = _crossing(profile, out_px, level)
            if crossing is not None and abs(crossing) <= reach_px:
                found.append((points[0] + (crossing + FAR_PX) * side * normal[place], side, place))
    points_px, side, place = zip(*found, strict=True) if found else (np.empty((0, 2)), (), ())
    return Edges(np.array(points_px), np.array(side), np.array(place))


def _normals(T: Pose, radius_m: float, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Points (A, 2) on a circle's image, and its unit normals (A, 2) outward."""
    contour = circle_ellipse(T, radius_m, camera)
    at = contour.points(ANGLES)
    C = circle_conic(T, radius_m, camera)
    slope = (np.c_[at, np.ones(ANGLES)] @ C)[:, :2]
    slope *= np.sign(np.sum(slope * (at - contour.centre_px), 1, keepdims=True))
    return at, slope / np.linalg.norm(slope, axis=1, keepdims=True)


def _crossing(profile, out_px, level: float) -> float | None:
    """Where a profile (S,), NaN where it is hidden, falls to a level, nearest to the middle; None if it does
    not there, or if too little of it is shown."""
    known = np.isfinite(profile)
    ring, around = (profile[known & (sign * out_px > NEAR_PX)] for sign in (-1, 1))
    if min(len(ring), len(around)) < 5:
        return None
    bright, dark = np.median(ring), np.median(around)
    if bright - dark < LEAST_CONTRAST:
        return None
    x, y = out_px[known], profile[known] - (dark + level * (bright - dark))
    falls = np.flatnonzero((y[:-1] >= 0) & (y[1:] < 0) & (np.diff(x) <= LONGEST_GAP_PX))
    if not len(falls):
        return None
    places = x[falls] + (x[falls + 1] - x[falls]) * y[falls] / (y[falls] - y[falls + 1])
    return float(places[np.abs(places).argmin()])


def pose_of(seen: Edges, T_start: Pose, port: Port, camera: Camera) -> tuple[Pose, float, np.ndarray]:
    """The ring's pose of the branch of ``T_start``, how far (px) its edges are spread, and the distances (K,)
    px that remain; robust least squares."""
    homogeneous = np.c_[seen.points_px, np.ones(len(seen.points_px))]
    outer = seen.side == OUTER

    def pose(x) -> Pose:
        turn = Rotation.from_rotvec([x[0], x[1], 0.0]).as_matrix()
        return Pose(T_start.rotation @ turn, T_start.position_m * (1 + x[2]) + [x[3], x[4], 0])

    def off_px(x):
        T, off = pose(x), np.empty(len(outer))
        for chosen, radius_m in ((outer, port.ring_outer_radius_m), (~outer, port.ring_inner_radius_m)):
            points, C = homogeneous[chosen], circle_conic(T, radius_m, camera)
            Cx = points @ C
            off[chosen] = np.sum(points * Cx, 1) / (2 * np.linalg.norm(Cx[:, :2], axis=1))
        inside = circle_ellipse(T, port.ring_radius_m, camera).centre_px
        sign = -np.sign(np.r_[inside, 1] @ circle_conic(T, port.ring_radius_m, camera) @ np.r_[inside, 1])
        return sign * off - x[5] * seen.side

    scale = [0.05, 0.05, 0.01, 2e-3, 2e-3, 0.5]
    solved = least_squares(off_px, np.zeros(6), loss="soft_l1", f_scale=ROBUST_PX, x_scale=scale)
    return pose(solved.x), float(solved.x[5]), off_px(solved.x)
