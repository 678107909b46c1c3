"""The compiled part of the renderer: what a ray sees, and how much light leaves that point toward the eye.

Reflection is Lambert + GGX microfacets (Walter et al. 2007) and, for the ring and the markers, a lobe that
returns light toward its lamp.  Everything is in the port frame; ``s`` is a `Solid`, vectors are triples.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from .cad import FAR_M, MARKER, NOTHING, PANEL, RING, hit_panel, hit_port
from .compiler import njit

RETRO_PEAK_SR = 12.0  # retro-reflected radiance per irradiance, with lamp and eye in line
RETRO_WIDTH_RAD = np.deg2rad(3.0)
SOFT_RADIUS_M = 0.15
PENUMBRA_M2 = 0.002  # by which a soft lamp's shadow outgrows the port's bounding sphere, squared radii
LIFT_M = 1e-5  # a shadow ray starts this far off its surface


@njit(fastmath=True, error_model="numpy", inline="always")
def microfacet_lobe(nl, nv, nh, vh, a2, spread2):
    """Distribution times visibility of the microfacets, and Schlick's (1 - v.h)^5; ``a2`` is alpha squared.

    Visibility is Smith's, a product of shadowing and masking.  The distribution is the mean over a lamp whose
    disc takes pi ``spread2`` of the plane of slopes.  In that plane GGX is the stereographic image of an
    evenly covered sphere, so a disc holds as much of it as its cap: with q = a2 + tan^2 - spread2 and
    w^2 = q^2 + 4 a2 spread2 the mean is 2 a2 / (pi cos^4 w (w + q)).
    """
    cos2 = nh * nh
    q = 1.0 + cos2 * (a2 - 1.0 - spread2)
    w = np.sqrt(q * q + 4.0 * a2 * spread2 * cos2 * cos2)
    smith = (nl + np.sqrt(a2 + (1.0 - a2) * nl * nl)) * (nv + np.sqrt(a2 + (1.0 - a2) * nv * nv))
    grazing = 1.0 - vh
    square = grazing * grazing
    return 2.0 * a2 / (np.pi * w * (w + q) * smith), square * square * grazing


@njit(fastmath=True, error_model="numpy", inline="always")
def _look_up_texel(skin, column, row, out, channels):
    """Bilinear look-up of every channel of a skin at continuous texel coordinates."""
    rows, columns = skin.shape[:2]
    c = min(max(column - 0.5, 0.0), columns - 1.001)
    r = min(max(row - 0.5, 0.0), rows - 1.001)
    i, j = int(r), int(c)
    fr, fc = np.float32(r - i), np.float32(c - j)
    w00, w01 = (1 - fr) * (1 - fc), (1 - fr) * fc
    w10, w11 = fr * (1 - fc), fr * fc
    for k in range(channels):
        upper = w00 * skin[i, j, k] + w01 * skin[i, j + 1, k]
        out[k] = upper + w10 * skin[i + 1, j, k] + w11 * skin[i + 1, j + 1, k]


@njit(nogil=True, fastmath=True, error_model="numpy", inline="always")
def _visible_share(s, gx, gy, gz, x, y, z, spread_m, R):
    """Share of a lamp at (x, y, z) that the port lets through to a point (gx, gy, gz)."""
    lit, points = 0.0, 4 if spread_m > 0.0 else 1
    for k in range(points):
        u, v = spread_m * (2 * (k & 1) - 1), spread_m * ((k & 2) - 1)
        lx = x + R[0, 0] * u + R[1, 0] * v - gx
        ly = y + R[0, 1] * u + R[1, 1] * v - gy
        lz = z + R[0, 2] * u + R[1, 2] * v - gz
        distance = np.sqrt(lx * lx + ly * ly + lz * lz)
        near = 1.0 / distance
        lit += hit_port(s, gx, gy, gz, lx * near, ly * near, lz * near, distance)[1] == NOTHING
    return lit / points


@njit(fastmath=True, error_model="numpy", inline="always")
def _first_surface(s, origin, ray, bounds, eye_z, eye_outside):
    """First surface along a line of sight: (distance, surface, nx, ny, nz); the distance is FAR_M or more
    for a miss."""
    (ox, oy, oz), (dx, dy, dz), (x_lower, y_lower, x_upper, y_upper) = origin, ray, bounds
    what, nx, ny, nz = PANEL, 0.0, 0.0, 1.0
    t = (s.panel_top - oz) / dz
    px, py = ox + t * dx, oy + t * dy
    if oz < s.panel_top or t < 0.0 or not (x_lower < px < x_upper and y_lower < py < y_upper):
        t, nx, ny, nz = hit_panel(s, ox, oy, oz, dx, dy, dz)
    toward = ox * dx + oy * dy + eye_z * dz
    if toward < 0.0 and toward * toward > eye_outside:  # the ray meets the sphere around the port
        t2, seen, mx, my, mz = hit_port(s, ox, oy, oz, dx, dy, dz, t)
        if seen != NOTHING:
            t, what, nx, ny, nz = t2, seen, mx, my, mz
    return t, what, nx, ny, nz


@njit(fastmath=True, error_model="numpy", inline="always")
def _add_lamp(total, mat, colours, s, R, what, point, normal, ray, nv, outside, lamp, colour, radius_m):
    """Add the light of one lamp, at ``lamp`` (3,), that leaves a point toward the eye."""
    (px, py, pz), (nx, ny, nz), (dx, dy, dz) = point, normal, ray
    gx, gy, gz = px + LIFT_M * nx, py + LIFT_M * ny, pz + LIFT_M * nz
    lx, ly, lz = lamp[0] - px, lamp[1] - py, lamp[2] - pz
    near = 1.0 / np.sqrt(lx * lx + ly * ly + lz * lz)
    lx, ly, lz = lx * near, ly * near, lz * near
    nl = nx * lx + ny * ly + nz * lz
    if nl <= 0.0:
        return
    if lamp[2] < s.panel_top and hit_panel(s, gx, gy, gz, lx, ly, lz)[0] * near < 1.0:
        return  # a lamp behind the panel
    lit, soft = 1.0, radius_m > SOFT_RADIUS_M
    toward = gx * lx + gy * ly + (gz - s.bound_height) * lz
    beyond = outside - soft * PENUMBRA_M2
    if toward * toward > beyond and (toward < 0.0 or beyond < 0.0):  # the port may be between
        lit = _visible_share(s, gx, gy, gz, lamp[0], lamp[1], lamp[2], soft * 0.5 * radius_m, R)
        if lit == 0.0:
            return
    lv = -(lx * dx + ly * dy + lz * dz)
    half = 1.0 / np.sqrt(max(2.0 + 2.0 * lv, 1e-9))  # 1 / |l + v|
    nh, vh = (nl + nv) * half, (1.0 + lv) * half
    alpha = mat[2 * colours]
    # half vectors move by half the lamp's angle, / v.h across the plane of incidence
    spread2 = (0.5 * radius_m * near) ** 2 / (vh * nh * nh * nh)
    lobe, fresnel = microfacet_lobe(nl, nv, nh, vh, alpha * alpha, spread2)
    white, metal = lobe * fresnel, lobe * (1.0 - fresnel)
    if what in (RING, MARKER):
        # small angles: |l - v|^2 = 2 - 2 l.v is the observation angle squared
        white += RETRO_PEAK_SR * np.exp(2.0 * (lv - 1.0) / RETRO_WIDTH_RAD**2)
    gain = nl * near * near * lit
    for c in range(colours):
        total[c] += colour[c] * gain * (mat[c] * (1 / np.pi) + mat[colours + c] * metal + white)


@cache
def shading_kernel(colours: int):
    """The renderer for one (event sensor) or three (RGB) colours, compiled on its first call."""
    channels = 2 * colours + 3  # diffuse and specular of each colour, roughness, two slopes

    def kernel(s, skin, lamps, intensity, radii, parts, R, origin, rays, backdrop, ambient):
        samples, height, width = rays.shape[:3]
        radiance = np.zeros((height, width, colours), np.float32)
        cover = np.zeros((height, width, 2), np.float32)
        bounds = s.panel_lower[0], s.panel_lower[1], s.panel_upper[0], s.panel_upper[1]
        texel_x = skin.shape[1] / (bounds[2] - bounds[0])
        texel_y = skin.shape[0] / (bounds[3] - bounds[1])
        ox, oy, oz = origin[0], origin[1], origin[2]
        eye_z = oz - s.bound_height
        eye_outside = ox * ox + oy * oy + eye_z * eye_z - s.bound_radius2
        share = np.float32(1.0 / samples)
        mat, total = np.zeros(channels, np.float32), np.zeros(colours, np.float32)
        for row in range(height):
            for column in range(width):
                total[:] = 0.0
                for k in range(samples):
                    a, b, f = rays[k, row, column, 0], rays[k, row, column, 1], rays[k, row, column, 2]
                    dx = R[0, 0] * a + R[1, 0] * b + R[2, 0] * f
                    dy = R[0, 1] * a + R[1, 1] * b + R[2, 1] * f
                    dz = R[0, 2] * a + R[1, 2] * b + R[2, 2] * f
                    ray = dx, dy, dz
                    t, what, nx, ny, nz = _first_surface(s, (ox, oy, oz), ray, bounds, eye_z, eye_outside)
                    if t >= FAR_M:
                        for c in range(colours):
                            total[c] += backdrop[row, column, c]
                        continue
                    px, py, pz = ox + t * dx, oy + t * dy, oz + t * dz
                    if what == PANEL:
                        x, y = (px - bounds[0]) * texel_x, (py - bounds[1]) * texel_y
                        _look_up_texel(skin, x, y, mat, channels)
                        if nz > 0.5:  # the front: the skin's slopes turn its normal
                            nx, ny = -mat[2 * colours + 1], -mat[2 * colours + 2]
                            nz = 1.0 / np.sqrt(nx * nx + ny * ny + 1.0)
                            nx, ny = nx * nz, ny * nz
                    else:
                        for c in range(colours):
                            mat[c], mat[colours + c] = parts[what, 0], parts[what, 1]
                        mat[2 * colours] = parts[what, 2]
                    if what == RING:
                        cover[row, column, 0] += share
                    elif what == MARKER:
                        cover[row, column, 1] += share
                    nv = -(nx * dx + ny * dy + nz * dz)
                    if nv < 0.0 and what != PANEL:  # a thin part from behind; a crease stays as it is
                        nx, ny, nz, nv = -nx, -ny, -nz, -nv
                    nv = max(nv, 0.02)
                    for c in range(colours):
                        total[c] += ambient[c] * (mat[c] + mat[colours + c])
                    gx, gy, gz = px + LIFT_M * nx, py + LIFT_M * ny, pz + LIFT_M * nz
                    gh = gz - s.bound_height
                    outside = gx * gx + gy * gy + gh * gh - s.bound_radius2
                    point, normal = (px, py, pz), (nx, ny, nz)
                    for i in range(len(lamps)):
                        _add_lamp(total, mat, colours, s, R, what, point, normal, ray, nv, outside,
                                  lamps[i], intensity[i], radii[i])  # fmt: skip
                for c in range(colours):
                    radiance[row, column, c] = total[c] * share
        return radiance, cover

    # numba keeps constants by this name, also of kernels that other processes compiled: each needs its own
    kernel.__qualname__ += f"_{colours}"
    return njit(nogil=True, fastmath=True, error_model="numpy")(kernel)
