"""The bench's light: lamps, materials and the camera's radiance and pixels.

Radiance, in one linear unit, leaves each surface as Lambert + GGX microfacet (Walter et al. 2007)
and, for the ring and the markers, a retro-reflected lobe about the direction of the lamp.  Lamps are
small spheres in the camera frame; a lamp's size widens the microfacet lobe that sees it.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numba import njit, prange

from .core import Camera, Pose
from .geometry import bearings
from .scene import MARKER, NOTHING, PANEL, PETAL, PLATE, RING, Solid, hit_panel, hit_port

RETRO_PEAK_SR = 12.0  # retro-reflected radiance per irradiance, lamp and eye in line
RETRO_WIDTH_RAD = np.deg2rad(3.0)
AMBIENT = 0.004  # of the lamps' summed intensity: what dark walls send back
# diffuse albedo, specular reflectance, GGX roughness of the port's parts, by surface number
PARTS = np.zeros((7, 3))
PARTS[RING], PARTS[MARKER] = (0.30, 0.04, 0.45), (0.30, 0.04, 0.45)
PARTS[PLATE], PARTS[PETAL], PARTS[6] = (0.20, 0.25, 0.35), (0.08, 0.10, 0.30), (0.05, 0.05, 0.40)


class Lamps(NamedTuple):
    """Lamps in the camera frame: position (L, 3) m, radiant intensity RGB (L, 3), radius (L,) m."""

    position_m: np.ndarray
    intensity: np.ndarray
    radius_m: np.ndarray


@njit(cache=True, fastmath=True, error_model="numpy", inline="always")
def _microfacet(nl, nv, nh, vh, f0, alpha):
    """GGX distribution, height-correlated Smith visibility (Hammon's form), Schlick's Fresnel."""
    a2 = alpha * alpha
    d = a2 / (np.pi * (nh * nh * (a2 - 1.0) + 1.0) ** 2)
    visibility = 0.5 / ((1.0 - alpha) * 2.0 * nl * nv + alpha * (nl + nv))
    return d * visibility * (f0 + (1.0 - f0) * (1.0 - vh) ** 5)


@njit(cache=True, fastmath=True, error_model="numpy")
def _texel(skin, column, row, out):
    """Bilinear look-up of every channel of a skin at continuous texel coordinates."""
    rows, columns = skin.shape[:2]
    c = min(max(column - 0.5, 0.0), columns - 1.001)
    r = min(max(row - 0.5, 0.0), rows - 1.001)
    i, j = int(r), int(c)
    fr, fc = r - i, c - j
    for k in range(skin.shape[2]):
        top = skin[i, j, k] * (1 - fc) + skin[i, j + 1, k] * fc
        low = skin[i + 1, j, k] * (1 - fc) + skin[i + 1, j + 1, k] * fc
        out[k] = top * (1 - fr) + low * fr


@njit(cache=True, fastmath=True, error_model="numpy", parallel=True)
def _render(s, skin, lamps, intensity, radii, parts, R, origin, rays, backdrop, ambient):
    samples, height, width = rays.shape[:3]
    radiance = np.zeros((height, width, 3), np.float32)
    cover = np.zeros((height, width, 2), np.float32)
    texel_x = skin.shape[1] / (s.panel_high[0] - s.panel_low[0])
    texel_y = skin.shape[0] / (s.panel_high[1] - s.panel_low[1])
    ox, oy, oz = origin
    for row in prange(height):
        mat = np.zeros(skin.shape[2])
        for column in range(width):
            for k in range(samples):
                a, b = rays[k, row, column]
                scale = 1.0 / np.sqrt(a * a + b * b + 1.0)
                dx = (R[0, 0] * a + R[1, 0] * b + R[2, 0]) * scale
                dy = (R[0, 1] * a + R[1, 1] * b + R[2, 1]) * scale
                dz = (R[0, 2] * a + R[1, 2] * b + R[2, 2]) * scale
                t, nx, ny, nz = hit_panel(s, ox, oy, oz, dx, dy, dz)
                t2, what, mx, my, mz = hit_port(s, ox, oy, oz, dx, dy, dz, t)
                if what == NOTHING and t == np.inf:
                    for c in range(3):
                        radiance[row, column, c] += backdrop[row, column, c] / samples
                    continue
                px, py, pz = ox + t2 * dx, oy + t2 * dy, oz + t2 * dz
                if what == NOTHING:
                    what = PANEL
                    _texel(skin, (px - s.panel_low[0]) * texel_x, (py - s.panel_low[1]) * texel_y, mat)
                    if nz > 0.5:
                        nx, ny = -mat[7], -mat[8]
                        norm = 1.0 / np.sqrt(nx * nx + ny * ny + 1.0)
                        nx, ny, nz = nx * norm, ny * norm, norm
                else:
                    nx, ny, nz = mx, my, mz
                    for c in range(3):
                        mat[c], mat[3 + c] = parts[what, 0], parts[what, 1]
                    mat[6] = parts[what, 2]
                if what == RING:
                    cover[row, column, 0] += 1.0 / samples
                elif what == MARKER:
                    cover[row, column, 1] += 1.0 / samples
                nv = -(nx * dx + ny * dy + nz * dz)
                if nv < 0.0:
                    nx, ny, nz, nv = -nx, -ny, -nz, -nv
                nv = max(nv, 0.02)
                for c in range(3):
                    radiance[row, column, c] += ambient[c] * (mat[c] + mat[3 + c]) / samples
                for i in range(len(lamps)):
                    lx, ly, lz = lamps[i, 0] - px, lamps[i, 1] - py, lamps[i, 2] - pz
                    distance = np.sqrt(lx * lx + ly * ly + lz * lz)
                    lx, ly, lz = lx / distance, ly / distance, lz / distance
                    nl = nx * lx + ny * ly + nz * lz
                    if nl <= 0.0:
                        continue
                    gx, gy, gz = px + 1e-5 * nx, py + 1e-5 * ny, pz + 1e-5 * nz
                    if hit_port(s, gx, gy, gz, lx, ly, lz, distance)[1] != NOTHING:
                        continue
                    hx, hy, hz = lx - dx, ly - dy, lz - dz
                    norm = 1.0 / np.sqrt(hx * hx + hy * hy + hz * hz)
                    nh = (nx * hx + ny * hy + nz * hz) * norm
                    vh = -(dx * hx + dy * hy + dz * hz) * norm
                    alpha = min(mat[6] + 0.5 * radii[i] / distance, 1.0)
                    lobe = _microfacet(nl, nv, nh, vh, 0.0, alpha)
                    peak = _microfacet(nl, nv, nh, vh, 1.0, alpha)
                    retro = 0.0
                    if what in (RING, MARKER):
                        # small angles: |l - v|^2 is the observation angle squared
                        angle2 = (lx + dx) ** 2 + (ly + dy) ** 2 + (lz + dz) ** 2
                        retro = RETRO_PEAK_SR * np.exp(-angle2 / RETRO_WIDTH_RAD**2)
                    gain = nl / (distance * distance * samples)
                    for c in range(3):
                        specular = lobe + mat[3 + c] * (peak - lobe)
                        radiance[row, column, c] += (
                            intensity[i, c] * gain * (mat[c] / np.pi + specular + retro)
                        )
    return radiance, cover


def ray_grid(camera: Camera, samples: int = 2) -> np.ndarray:
    """Normalised directions of each pixel's samples on an n-rooks pattern, (samples, H, W, 2)."""
    rank = np.arange(samples)
    offsets = (np.stack([rank, (rank * 2 + 1) % (samples + 1 - samples % 2)], -1) + 0.5) / samples - 0.5
    v, u = np.indices((camera.height_px, camera.width_px))
    pixels = np.stack([u, v], -1) + offsets[:, None, None, :]
    return np.ascontiguousarray(bearings(pixels, camera)[..., :2])


def render(solid: Solid, skin, lamps: Lamps, T_cam_port: Pose, rays, backdrop):
    """Radiance (H, W, 3) f32 of the scene, and the share of each pixel that shows the ring and the
    markers, (H, W, 2) f32 in [0, 1]."""
    T_port_cam = T_cam_port.inverse
    ambient = AMBIENT * lamps.intensity.sum(0)
    return _render(solid, skin, T_port_cam @ lamps.position_m, lamps.intensity, lamps.radius_m, PARTS,
                   T_cam_port.rotation, T_port_cam.position_m, rays, backdrop, ambient)  # fmt: skip


def blur(radiance, sigma_px: float) -> np.ndarray:
    """The lens' point spread as a Gaussian."""
    return cv2.GaussianBlur(radiance, (0, 0), sigma_px, borderType=cv2.BORDER_REPLICATE)


def luminance(radiance) -> np.ndarray:
    """(H, W, 3) -> (H, W): what a pixel without colour filter sees (Rec. 709 weights)."""
    return radiance @ np.array([0.2126, 0.7152, 0.0722], np.float32)


def expose(radiance, gain: float, rng, full_well: float = 7000.0, read_noise: float = 25.0) -> np.ndarray:
    """8-bit frame: photo-electrons with shot and read noise (electrons), saturated and rounded."""
    electrons = np.minimum(radiance * gain, 4.0) * full_well
    noisy = electrons + rng.standard_normal(electrons.shape, np.float32) * np.sqrt(electrons + read_noise**2)
    return np.clip(np.rint(noisy * (255 / full_well)), 0, 255).astype(np.uint8)
