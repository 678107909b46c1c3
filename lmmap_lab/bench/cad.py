"""The bench's geometry: the port's CAD on its panel as analytic surfaces, and rays against them.

Everything is in the port frame.  The surfaces are the panel (a slab), the ring (an annulus and its two
walls), the stem (a cylinder), the plate (a hexagon with windows) with its markers, and the petals
(trapezoids).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from lmmap.types import Port

from .compiler import njit

NOTHING, PANEL, RING, MARKER, PLATE, PETAL, BODY = range(7)
PANEL_THICKNESS_M = 0.022
CLEARANCE_M = 1e-6
FAR_M = 1e9  # distance of a miss; infinity would not survive fast arithmetic


class Solid(NamedTuple):
    """A `Port` as plain numbers for the compiled kernels (metres)."""

    ring_inner: float
    ring_outer: float
    panel_top: float
    panel_bottom: float
    panel_lower: np.ndarray  # (2,) least x, y
    panel_upper: np.ndarray  # (2,)
    stem: float
    plate_height: float
    plate_apothem: float
    sectors: np.ndarray  # (S, 2) unit vectors to the markers
    marker_radius: float
    marker_half: np.ndarray  # (2,) tangential, radial
    window_sectors: np.ndarray  # (S, 2) unit vectors to the windows, which are cut through the plate
    window_radius: float
    window_half: np.ndarray  # (2,) tangential, radial; zero: none
    petals: np.ndarray  # (S, 4, 3): base point, tangent, up, normal
    petal_half_widths: np.ndarray  # (2,) at the base, at the tip
    petal_length: float
    bound_height: float  # centre of the sphere around everything but the panel
    bound_radius2: float
    head_height: float  # centre of the sphere around plate and petals
    head_radius2: float


def solid(port: Port, panel_centre_m=(0.0, 0.0)) -> Solid:
    """The numbers of a port; ``panel_centre_m`` (x, y) is the panel's middle in the port frame."""
    apothem = port.apothem_m
    yaws = np.arange(port.symmetry) * port.yaw_period_rad
    between = yaws + port.yaw_period_rad / 2
    length = np.hypot(port.petal_rise_m, port.petal_lean_m)
    up = np.array([port.petal_lean_m, 0, port.petal_rise_m]) / length
    frame = np.array([[apothem, 0, port.plate_height_m], [0, 1, 0], up, np.cross([0, 1, 0], up)])
    turns = [Rotation.from_rotvec([0, 0, a]).as_matrix() for a in yaws]
    half = np.array(port.panel_size_m) / 2
    top = port.plate_height_m + port.petal_rise_m
    middle = (top - port.panel_depth_m) / 2
    head = (top + port.plate_height_m) / 2
    reach = np.hypot(apothem + port.petal_lean_m, max(port.petal_widths_m) / 2)
    return Solid(
        port.ring_inner_radius_m,
        port.ring_outer_radius_m,
        -port.panel_depth_m,
        -port.panel_depth_m - PANEL_THICKNESS_M,
        np.array(panel_centre_m) - half,
        np.array(panel_centre_m) + half,
        port.stem_radius_m,
        port.plate_height_m,
        apothem,
        np.stack([np.cos(yaws), np.sin(yaws)], -1),
        port.marker_radius_m,
        np.array(port.marker_size_m) / 2,
        np.stack([np.cos(between), np.sin(between)], -1),
        port.window_radius_m,
        np.array(port.window_size_m) / 2,
        np.stack([frame @ R.T for R in turns]),
        np.array(port.petal_widths_m) / 2,
        length,
        middle,
        port.ring_outer_radius_m**2 + (top - middle) ** 2,
        head,
        max(reach, port.plate_circumradius_m) ** 2 + (top - head) ** 2,
    )


def without_port(solid: Solid) -> Solid:
    """The bare panel: no ray meets the sphere around the port."""
    return solid._replace(bound_radius2=-1.0)


@njit(fastmath=True, error_model="numpy", inline="always")
def _hit_wall(ox, oy, oz, dx, dy, dz, radius, lower, upper, t_max):
    """Distance of the nearest hit of an upright cylinder's wall between two heights, or t_max."""
    a = dx * dx + dy * dy
    b = ox * dx + oy * dy
    disc = b * b - a * (ox * ox + oy * oy - radius * radius)
    if disc <= 0.0 or a == 0.0:
        return t_max
    root = np.sqrt(disc)
    for t in ((-b - root) / a, (-b + root) / a):
        if CLEARANCE_M < t < t_max and lower < oz + t * dz < upper:
            return t
    return t_max


@njit(fastmath=True, error_model="numpy", inline="always")
def _misses_sphere(ox, oy, oz, dx, dy, dz, height, radius2):
    """Whether a ray misses the sphere around (0, 0, height)."""
    cz = oz - height
    toward = ox * dx + oy * dy + cz * dz
    outside = ox * ox + oy * oy + cz * cz - radius2
    return toward * toward < outside or (toward > 0.0 and outside > 0.0)


@njit(fastmath=True, error_model="numpy", inline="always")
def _in_window(s, x, y):
    """Whether a point of the plate is in one of its windows."""
    for k in range(len(s.window_sectors)):
        c, n = s.window_sectors[k, 0], s.window_sectors[k, 1]
        if abs(x * c + y * n - s.window_radius) < s.window_half[1] and abs(y * c - x * n) < s.window_half[0]:
            return True
    return False


@njit(fastmath=True, error_model="numpy", inline="always")
def hit_port(s, ox, oy, oz, dx, dy, dz, t_max):
    """First surface of the port along a ray: (distance, surface, nx, ny, nz), without the panel."""
    t, what, nx, ny, nz = t_max, NOTHING, 0.0, 0.0, 0.0
    if _misses_sphere(ox, oy, oz, dx, dy, dz, s.bound_height, s.bound_radius2):
        return t, what, nx, ny, nz

    u = -oz / dz  # ring: annulus in z = 0
    if CLEARANCE_M < u < t:
        r2 = (ox + u * dx) ** 2 + (oy + u * dy) ** 2
        if s.ring_inner**2 < r2 < s.ring_outer**2:
            t, what, nx, ny, nz = u, RING, 0.0, 0.0, 1.0
    for radius, lower, upper in (
        (s.ring_outer, s.panel_top, 0.0),
        (s.ring_inner, s.panel_top, 0.0),
        (s.stem, s.panel_top, s.plate_height),
    ):
        u = _hit_wall(ox, oy, oz, dx, dy, dz, radius, lower, upper, t)
        if u < t:
            t, what = u, BODY
            nx, ny, nz = (ox + u * dx) / radius, (oy + u * dy) / radius, 0.0
    if _misses_sphere(ox, oy, oz, dx, dy, dz, s.head_height, s.head_radius2):
        return t, what, nx, ny, nz

    u = (s.plate_height - oz) / dz  # plate: hexagon
    if CLEARANCE_M < u < t:
        x, y = ox + u * dx, oy + u * dy
        radial = tangential = far = -1.0
        for k in range(len(s.sectors)):
            c, n = s.sectors[k, 0], s.sectors[k, 1]
            along = x * c + y * n
            far = max(far, abs(along))
            if along > radial:
                radial, tangential = along, abs(y * c - x * n)
        if far < s.plate_apothem and not _in_window(s, x, y):
            t, what, nx, ny, nz = u, PLATE, 0.0, 0.0, 1.0
            if tangential < s.marker_half[0] and abs(radial - s.marker_radius) < s.marker_half[1]:
                what = MARKER

    for k in range(len(s.petals)):
        p = s.petals[k]
        slope = dx * p[3, 0] + dy * p[3, 1] + dz * p[3, 2]
        qx, qy, qz = p[0, 0] - ox, p[0, 1] - oy, p[0, 2] - oz
        u = (qx * p[3, 0] + qy * p[3, 1] + qz * p[3, 2]) / slope
        if CLEARANCE_M < u < t:
            x, y, z = u * dx - qx, u * dy - qy, u * dz - qz
            v = (x * p[2, 0] + y * p[2, 1] + z * p[2, 2]) / s.petal_length
            w = abs(x * p[1, 0] + y * p[1, 1] + z * p[1, 2])
            if 0.0 < v < 1.0 and w < (1 - v) * s.petal_half_widths[0] + v * s.petal_half_widths[1]:
                t, what, nx, ny, nz = u, PETAL, p[3, 0], p[3, 1], p[3, 2]
    return t, what, nx, ny, nz


@njit(fastmath=True, error_model="numpy", inline="always")
def hit_panel(s, ox, oy, oz, dx, dy, dz):
    """First hit of the panel's slab: (distance, nx, ny, nz); the distance is `FAR_M` for a miss."""
    near, far, axis, sign = -FAR_M, FAR_M, 2, 1.0
    lower = (s.panel_lower[0], s.panel_lower[1], s.panel_bottom)
    upper = (s.panel_upper[0], s.panel_upper[1], s.panel_top)
    o, d = (ox, oy, oz), (dx, dy, dz)
    for k in range(3):
        a, b = (lower[k] - o[k]) / d[k], (upper[k] - o[k]) / d[k]
        if min(a, b) > near:
            near, axis, sign = min(a, b), k, (-1.0 if d[k] > 0 else 1.0)
        far = min(far, max(a, b))
    if near > far or near < CLEARANCE_M:
        return FAR_M, 0.0, 0.0, 0.0
    return near, sign * (axis == 0), sign * (axis == 1), sign * (axis == 2)
