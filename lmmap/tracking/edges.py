"""Events at the port's projected edges: which edge an event belongs to, and its distance from that edge.

Edges are cut into bins.  At a pose, each bin has a point on its edge, the image normal n, which points away
from the bright side, and the row of the Jacobian

    h = n' J [I, -[R q]x],

where q is the point in the port's frame and J the derivative of the projection.  A small change (dp, r) of
the pose (conventions of `uncertainty`) moves the edge by h (dp, r) pixels along n.  Pixels are those of the
same camera without distortion.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..geometry.compiled import njit
from ..geometry.projection import bearings, project
from ..refinement.verify import hidden
from ..types import Camera, Port, Pose
from ..types.arrays import frozen_array

RING_BINS = 72  # of each of the ring's two edges
SIDE_BINS = 4  # of each side of a marker
CORNER = 0.1  # of a side's length at both ends, where the event may be the other side's


@dataclass(frozen=True)
class Edges:
    """The port's edges in bins: points (B, 3), tangents (B, 3) and outward directions (B, 3) in the port's
    frame.

    Outward is away from the bright side, in the plane of the edge.  The order is the ring's outer edge, its
    inner edge, and of each marker the side far from the axis, the side near to it, and the two others.
    """

    points_m: np.ndarray
    tangents: np.ndarray
    outward: np.ndarray

    @classmethod
    @lru_cache
    def of(cls, port: Port) -> Edges:
        """The edges of a port."""
        angle = (np.arange(RING_BINS) + 0.5) * (2 * np.pi / RING_BINS) - np.pi
        radial, tangent = _directions(angle)
        points = [port.ring_outer_radius_m * radial, port.ring_inner_radius_m * radial]
        tangents, outward = [tangent, tangent], [radial, -radial]
        half_tangential, half_radial = np.array(port.marker_size_m) / 2
        along = (1 - 2 * CORNER) * ((np.arange(SIDE_BINS) + 0.5) / SIDE_BINS * 2 - 1)[:, None]
        ones = np.ones((SIDE_BINS, 1))
        for yaw in np.arange(port.symmetry) * port.yaw_period_rad:
            r, t = _directions(yaw)
            middle = port.marker_radius_m * r + np.array([0, 0, port.plate_height_m])
            for out, reach_m, side, half_m in (
                (r, half_radial, t, half_tangential),
                (-r, half_radial, t, half_tangential),
                (t, half_tangential, r, half_radial),
                (-t, half_tangential, r, half_radial),
            ):
                points.append(middle + reach_m * out + half_m * along * side)
                tangents.append(ones * side)
                outward.append(ones * out)
        return cls(*(frozen_array(np.concatenate(parts)) for parts in (points, tangents, outward)))

    def visible(self, T_cam_port: Pose, port: Port, camera: Camera) -> np.ndarray:
        """Which bins (B,) are inside the image and hidden neither by the plate nor by the petals."""
        with np.errstate(invalid="ignore"):
            pixel = project(T_cam_port @ self.points_m, camera)
            inside = np.all((pixel > 0) & (pixel < np.array(camera.size_px) - 1), -1)
        faces = T_cam_port.normal @ T_cam_port.position_m < 0
        return inside & faces & ~hidden(self.points_m, T_cam_port.inverse.position_m, port)

    def jacobian(self, T_cam_port: Pose, camera: Camera) -> np.ndarray:
        """Rows h (B, 6) in px/m and px/rad."""
        arm = self.points_m @ T_cam_port.rotation.T
        q, focal = arm + T_cam_port.position_m, np.array([camera.fx_px, camera.fy_px])
        xy = q[:, :2] / q[:, 2:]

        def image(direction):
            v = direction @ T_cam_port.rotation.T
            return focal * (v[:, :2] - xy * v[:, 2:]) / q[:, 2:]

        along = image(self.tangents)
        n = np.stack([along[:, 1], -along[:, 0]], -1)
        n *= np.sign(np.sum(n * image(self.outward), -1, keepdims=True))
        n /= np.maximum(np.linalg.norm(n, axis=-1, keepdims=True), 1e-12)
        slope = n * focal / q[:, 2:]
        g = np.column_stack([slope, -np.sum(slope * xy, -1)])
        return np.column_stack([g, np.cross(arm, g)])


def _directions(angle_rad):
    """Radial and tangential unit vectors in the port's frame, (N, 3)."""
    c, s = np.cos(np.atleast_1d(angle_rad)), np.sin(np.atleast_1d(angle_rad))
    o = np.zeros_like(c)
    return np.stack([c, s, o], -1), np.stack([-s, c, o], -1)


class EdgeFinder:
    """Finds the events at the edges of one port in one camera."""

    def __init__(self, port: Port, camera: Camera):
        self.port, self.camera, self.edges = port, camera, Edges.of(port)
        v, u = np.indices((camera.height_px, camera.width_px))
        self._rays = bearings(np.stack([u, v], -1), camera)[..., :2].astype(np.float32)

    def __call__(self, events, T_cam_port: Pose, usable, gate_px: float):
        """Find the events (M,) within ``gate_px`` of the nearest edge at a pose, in ``usable`` (B,) bins.

        Returns
        -------
        count, sum_px : (2, B)
            By polarity, the number of events at each bin and the sum of their distances from the edge,
            outward.
        """
        port, count = self.port, np.zeros((2, len(self.edges.points_m)))
        sum_px = np.zeros_like(count)
        _sort_to_edges(
            events["x"], events["y"], events["p"], self._rays,
            np.ascontiguousarray(T_cam_port.rotation), np.ascontiguousarray(T_cam_port.position_m),
            self.camera.fx_px, self.camera.fy_px,
            np.array([port.ring_outer_radius_m, port.ring_inner_radius_m]),
            port.plate_height_m, port.symmetry, port.marker_radius_m, np.array(port.marker_size_m) / 2,
            np.ascontiguousarray(usable), gate_px, count, sum_px,
        )  # fmt: skip
        return count, sum_px


@njit(nogil=True, error_model="numpy")
def _sort_to_edges(xs, ys, ps, rays, R, p, fx, fy, radii, height, symmetry, middle, half, usable, gate_px,
                   count, sum_px):  # fmt: skip
    """Adds each event to the bin of the nearest edge within the gate, in ``count`` and ``sum_px``."""
    ex = -(R[0, 0] * p[0] + R[1, 0] * p[1] + R[2, 0] * p[2])  # the eye in the port's frame
    ey = -(R[0, 1] * p[0] + R[1, 1] * p[1] + R[2, 1] * p[2])
    ez = -(R[0, 2] * p[0] + R[1, 2] * p[1] + R[2, 2] * p[2])
    if ez <= height:
        return
    for i in range(len(xs)):
        x, y = rays[ys[i], xs[i], 0], rays[ys[i], xs[i], 1]
        dx = R[0, 0] * x + R[1, 0] * y + R[2, 0]
        dy = R[0, 1] * x + R[1, 1] * y + R[2, 1]
        dz = R[0, 2] * x + R[1, 2] * y + R[2, 2]
        if dz >= 0.0:
            continue
        nearest, best = -1, gate_px

        s = -ez / dz  # the ring's plane
        X, Y = ex + s * dx, ey + s * dy
        r = np.sqrt(X * X + Y * Y)
        for k in range(2):
            if abs(r - radii[k]) * fx > 3.0 * gate_px * s:  # s is the depth along the unit ray (x, y, 1)
                continue
            e = (r - radii[k]) * _px_per_m(R, x, y, s, fx, fy, X / r, Y / r, -Y / r, X / r)
            if abs(e) < abs(best):
                b = int((np.arctan2(Y, X) + np.pi) / (2 * np.pi) * RING_BINS) % RING_BINS + k * RING_BINS
                if usable[b]:
                    nearest, best = b, (e if k == 0 else -e)

        s = (height - ez) / dz  # the markers' plane
        X, Y = ex + s * dx, ey + s * dy
        far = 3.0 * gate_px * s / fx
        if np.hypot(X, Y) < middle + half[0] + half[1] + far:
            for m in range(symmetry):
                c, n = np.cos(m * 2 * np.pi / symmetry), np.sin(m * 2 * np.pi / symmetry)
                a, t = X * c + Y * n - middle, Y * c - X * n
                if abs(a) > half[1] + far or abs(t) > half[0] + far:
                    continue
                for side in range(4):
                    if side < 2:
                        sign, d, along, reach = (1.0 - 2.0 * side), a, t, half[0]
                        off = sign * d - half[1]
                        ox, oy = sign * c, sign * n
                    else:
                        sign, d, along, reach = (5.0 - 2.0 * side), t, a, half[1]
                        off = sign * d - half[0]
                        ox, oy = -sign * n, sign * c
                    place = (along / (reach * (1.0 - 2.0 * CORNER)) + 1.0) / 2.0
                    if place < 0.0 or place >= 1.0 or abs(off) > far:
                        continue
                    e = off * _px_per_m(R, x, y, s, fx, fy, ox, oy, -oy, ox)
                    if abs(e) < abs(best):
                        b = 2 * RING_BINS + (m * 4 + side) * SIDE_BINS + int(place * SIDE_BINS)
                        if usable[b]:
                            nearest, best = b, e
        if nearest >= 0:
            count[int(ps[i]), nearest] += 1.0
            sum_px[int(ps[i]), nearest] += best


@njit(nogil=True, error_model="numpy")
def _px_per_m(R, x, y, s, fx, fy, ox, oy, tx, ty):
    """How many pixels along the edge's image normal a metre along the direction (ox, oy, 0) of the port is.

    The edge's tangent is (tx, ty, 0), and the place is at depth s on the ray (x, y, 1).
    """
    az = R[2, 0] * ox + R[2, 1] * oy
    au, av = fx * (R[0, 0] * ox + R[0, 1] * oy - x * az), fy * (R[1, 0] * ox + R[1, 1] * oy - y * az)
    bz = R[2, 0] * tx + R[2, 1] * ty
    bu, bv = fx * (R[0, 0] * tx + R[0, 1] * ty - x * bz), fy * (R[1, 0] * tx + R[1, 1] * ty - y * bz)
    return abs(au * bv - av * bu) / (np.sqrt(bu * bu + bv * bv) * s)
