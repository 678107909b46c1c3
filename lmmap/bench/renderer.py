"""The bench's light: lamps, materials and the camera's radiance and pixels.

Radiance, in one linear unit, leaves each surface as Lambert + GGX microfacet (Walter et al. 2007)
and, for the ring and the markers, a retro-reflected lobe about the direction of the lamp.  Lamps are
small spheres in the camera frame; a lamp's size widens the microfacet lobe that sees it.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from ..geometry.projection import bearings
from ..types import Camera, Pose
from .cad import FAR_M, MARKER, NOTHING, PANEL, PETAL, PLATE, RING, Solid, hit_panel, hit_port
from .compiler import njit

RETRO_PEAK_SR = 12.0  # retro-reflected radiance per irradiance, lamp and eye in line
RETRO_WIDTH_RAD = np.deg2rad(3.0)
SOFT_RADIUS_M = 0.15
PENUMBRA_M2 = 0.002  # by which a soft lamp's shadow outgrows the port's bounding sphere, squared radii
LIFT_M = 1e-5  # off the surface before looking for what shadows it
GLARE = 0.03  # share of the light that a lens scatters widely (veiling glare of small machine-vision lenses)
AMBIENT = 0.0018  # of the summed intensity: walls of albedo 0.05 three metres away, 0.05 / (pi 3^2)
# diffuse albedo, specular reflectance, GGX roughness of the port's parts, by surface number
PARTS = np.zeros((7, 3))
PARTS[RING], PARTS[MARKER] = (0.30, 0.04, 0.45), (0.30, 0.04, 0.45)
PARTS[PLATE], PARTS[PETAL], PARTS[6] = (0.20, 0.25, 0.35), (0.08, 0.10, 0.30), (0.05, 0.05, 0.40)


class Lamps(NamedTuple):
    """Lamps in the camera frame: position (L, 3) m, radiant intensity (L, colours), radius (L,) m.

    A lamp's radius widens the microfacet lobe that sees it; the shadow of one above `SOFT_RADIUS_M` is the
    mean of four, from a square of half its size.
    """

    position_m: np.ndarray
    intensity: np.ndarray
    radius_m: np.ndarray


@njit(cache=True, fastmath=True, error_model="numpy", inline="always")
def _microfacet(nl, nv, nh, vh, f0, alpha):
    """GGX distribution, Smith's shadowing and masking (a product), Schlick's Fresnel (Walter et al. 2007)."""
    lobe, fresnel = _lobe(nl, nv, nh, vh, alpha * alpha, 0.0)
    return lobe * (f0 + (1.0 - f0) * fresnel)


@njit(cache=True, fastmath=True, error_model="numpy", inline="always")
def _lobe(nl, nv, nh, vh, a2, spread2):
    """Distribution times visibility of the microfacets, and (1 - v.h)^5; ``a2`` is alpha squared.

    The distribution is the mean over a lamp whose disc takes pi ``spread2`` of the plane of slopes.  There
    GGX is the stereographic image of an evenly covered sphere, so a disc holds as much of it as its cap: with
    q = a2 + tan^2 - spread2 and w^2 = q^2 + 4 a2 spread2 the mean is 2 a2 / (pi cos^4 w (w + q)).
    """
    cos2 = nh * nh
    q = 1.0 + cos2 * (a2 - 1.0 - spread2)
    w = np.sqrt(q * q + 4.0 * a2 * spread2 * cos2 * cos2)
    smith = (nl + np.sqrt(a2 + (1.0 - a2) * nl * nl)) * (nv + np.sqrt(a2 + (1.0 - a2) * nv * nv))
    grazing = 1.0 - vh
    square = grazing * grazing
    return 2.0 * a2 / (np.pi * w * (w + q) * smith), square * square * grazing


@njit(cache=True, fastmath=True, error_model="numpy", inline="always")
def _texel(skin, column, row, out, channels):
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


@njit(cache=True, nogil=True, fastmath=True, error_model="numpy", inline="always")
def _lit(s, gx, gy, gz, x, y, z, spread_m, R):
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


def _kernel(colours):
    """The renderer for one (event sensor) or three (RGB) colours, compiled on its first use."""
    channels = 2 * colours + 3
    alpha_at = 2 * colours

    @njit(cache=True, nogil=True, fastmath=True, error_model="numpy")
    def kernel(s, skin, lamps, intensity, radii, parts, R, origin, rays, backdrop, ambient):
        samples, height, width = rays.shape[:3]
        radiance = np.zeros((height, width, colours), np.float32)
        cover = np.zeros((height, width, 2), np.float32)
        texel_x = skin.shape[1] / (s.panel_high[0] - s.panel_low[0])
        texel_y = skin.shape[0] / (s.panel_high[1] - s.panel_low[1])
        low_x, low_y, high_x, high_y = s.panel_low[0], s.panel_low[1], s.panel_high[0], s.panel_high[1]
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
                    what, nx, ny, nz = PANEL, 0.0, 0.0, 1.0
                    t = (s.panel_top - oz) / dz
                    px, py = ox + t * dx, oy + t * dy
                    if oz < s.panel_top or t < 0.0 or not (low_x < px < high_x and low_y < py < high_y):
                        t, nx, ny, nz = hit_panel(s, ox, oy, oz, dx, dy, dz)
                    toward = ox * dx + oy * dy + eye_z * dz
                    if toward < 0.0 and toward * toward > eye_outside:
                        t2, seen, mx, my, mz = hit_port(s, ox, oy, oz, dx, dy, dz, t)
                        if seen != NOTHING:
                            t, what, nx, ny, nz = t2, seen, mx, my, mz
                    if t >= FAR_M:
                        for c in range(colours):
                            total[c] += backdrop[row, column, c]
                        continue
                    px, py, pz = ox + t * dx, oy + t * dy, oz + t * dz
                    if what == PANEL:
                        _texel(skin, (px - low_x) * texel_x, (py - low_y) * texel_y, mat, channels)
                        if nz > 0.5:
                            nx, ny = -mat[alpha_at + 1], -mat[alpha_at + 2]
                            nz = 1.0 / np.sqrt(nx * nx + ny * ny + 1.0)
                            nx, ny = nx * nz, ny * nz
                    else:
                        for c in range(colours):
                            mat[c], mat[colours + c] = parts[what, 0], parts[what, 1]
                        mat[alpha_at] = parts[what, 2]
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
                    for i in range(len(lamps)):
                        lx, ly, lz = lamps[i, 0] - px, lamps[i, 1] - py, lamps[i, 2] - pz
                        near = 1.0 / np.sqrt(lx * lx + ly * ly + lz * lz)
                        lx, ly, lz = lx * near, ly * near, lz * near
                        nl = nx * lx + ny * ly + nz * lz
                        if nl <= 0.0:
                            continue
                        if lamps[i, 2] < s.panel_top and hit_panel(s, gx, gy, gz, lx, ly, lz)[0] * near < 1.0:
                            continue  # a lamp behind the panel
                        lit, soft = 1.0, radii[i] > SOFT_RADIUS_M
                        toward = gx * lx + gy * ly + gh * lz
                        beyond = outside - soft * PENUMBRA_M2
                        if toward * toward > beyond and (toward < 0.0 or beyond < 0.0):
                            lit = _lit(s, gx, gy, gz, lamps[i, 0], lamps[i, 1], lamps[i, 2],
                                       soft * 0.5 * radii[i], R)  # fmt: skip
                            if lit == 0.0:
                                continue
                        lv = -(lx * dx + ly * dy + lz * dz)
                        half = 1.0 / np.sqrt(max(2.0 + 2.0 * lv, 1e-9))  # 1 / |l + v|
                        nh, vh = (nl + nv) * half, (1.0 + lv) * half
                        a2 = mat[alpha_at] * mat[alpha_at]
                        # half vectors move by half the lamp's angle, / v.h across the plane of incidence
                        spread2 = (0.5 * radii[i] * near) ** 2 / (vh * nh * nh * nh)
                        lobe, fresnel = _lobe(nl, nv, nh, vh, a2, spread2)
                        white, metal = lobe * fresnel, lobe * (1.0 - fresnel)
                        if what in (RING, MARKER):
                            # small angles: |l - v|^2 = 2 - 2 l.v is the observation angle squared
                            white += RETRO_PEAK_SR * np.exp(2.0 * (lv - 1.0) / RETRO_WIDTH_RAD**2)
                        gain = nl * near * near * lit
                        for c in range(colours):
                            total[c] += intensity[i, c] * gain * (
                                mat[c] * (1 / np.pi) + mat[colours + c] * metal + white
                            )  # fmt: skip
                for c in range(colours):
                    radiance[row, column, c] = total[c] * share
        return radiance, cover

    return kernel


_KERNELS = {colours: _kernel(colours) for colours in (1, 3)}


def ray_grid(camera: Camera, samples: int = 2) -> np.ndarray:
    """Unit directions of each pixel's samples on an n-rooks pattern, (samples, H, W, 3) f32."""
    rank = np.arange(samples)
    offsets = (np.stack([rank, (rank * 2 + 1) % (samples + 1 - samples % 2)], -1) + 0.5) / samples - 0.5
    v, u = np.indices((camera.height_px, camera.width_px))
    pixels = np.stack([u, v], -1) + offsets[:, None, None, :]
    rays = bearings(pixels, camera)
    return (rays / np.linalg.norm(rays, axis=-1, keepdims=True)).astype(np.float32)


def render(solid: Solid, skin, lamps: Lamps, T_cam_port: Pose, rays, backdrop):
    """Radiance (H, W, colours) f32 of the scene, and the share of each pixel that shows the ring and the
    markers, (H, W, 2) f32 in [0, 1]."""
    T_port_cam = T_cam_port.inverse
    ambient = AMBIENT * lamps.intensity.sum(0)
    kernel = _KERNELS[backdrop.shape[-1]]
    return kernel(solid, skin, T_port_cam @ lamps.position_m, lamps.intensity, lamps.radius_m, PARTS,
                  T_cam_port.rotation, T_port_cam.position_m, rays, backdrop, ambient)  # fmt: skip


def to_monochrome(skin, lamps: Lamps, backdrop):
    """Skin, lamps and backdrop in the one colour of a pixel without filter, for one ray a pixel.

    Such a ray would alias: the skin is averaged over 2 x 2 texels, about a pixel at mid-range, and what
    slopes that takes away widens the microfacet lobe, alpha^2 + 2 var(slope).
    """
    mono = np.concatenate([luminance(skin[..., 0:3]), luminance(skin[..., 3:6]), skin[..., 6:]], -1)
    blocks = mono[: len(mono) // 2 * 2, : mono.shape[1] // 2 * 2]
    blocks = (
        blocks.reshape(len(blocks) // 2, 2, -1, 2, 5)
        .transpose(0, 2, 1, 3, 4)
        .reshape(len(blocks) // 2, -1, 4, 5)
    )
    small = blocks.mean(2)
    small[..., 2] = np.sqrt(small[..., 2] ** 2 + 2 * blocks[..., 3:].var(2).mean(-1)).clip(max=1)
    lamps = lamps._replace(intensity=luminance(lamps.intensity))
    return small.astype(np.float32), lamps, np.ascontiguousarray(luminance(backdrop))


def blur(radiance, sigma_px: float) -> np.ndarray:
    """The lens' point spread as a Gaussian, (H, W, colours)."""
    return cv2.GaussianBlur(radiance, (0, 0), sigma_px, borderType=cv2.BORDER_REPLICATE).reshape(
        radiance.shape
    )


def apply_lens(radiance, sigma_px: float) -> np.ndarray:
    """The lens: a Gaussian core, and wide glare from scatter between its surfaces."""
    small = cv2.resize(radiance, None, fx=0.125, fy=0.125, interpolation=cv2.INTER_AREA)
    near, far = (cv2.GaussianBlur(small, (0, 0), s, borderType=cv2.BORDER_CONSTANT) for s in (2.0, 6.0))
    glare = cv2.resize(0.5 * (near + far), radiance.shape[1::-1], interpolation=cv2.INTER_LINEAR)
    core = blur(radiance, sigma_px)
    return core + np.float32(GLARE) * (glare.reshape(radiance.shape) - core)


def luminance(radiance) -> np.ndarray:
    """(..., 3) -> (..., 1): what a pixel without colour filter sees (Rec. 709 weights)."""
    return radiance @ np.array([[0.2126], [0.7152], [0.0722]], radiance.dtype)


def expose(radiance, gain: float, rng, full_well: float = 7000.0, read_noise: float = 25.0) -> np.ndarray:
    """8-bit frame: photo-electrons with shot and read noise (electrons), saturated and rounded."""
    electrons = np.minimum(radiance * gain, 4.0) * full_well
    noisy = electrons + rng.standard_normal(electrons.shape, np.float32) * np.sqrt(electrons + read_noise**2)
    return np.clip(np.rint(noisy * (255 / full_well)), 0, 255).astype(np.uint8)
