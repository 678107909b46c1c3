"""The panel's skins: crinkled metallised film, and covers that are nothing like a satellite's.

A skin is a map over the panel, ``(rows, columns, CHANNELS)`` float32 with one texel for each millimetre.  Its
channels are diffuse albedo RGB, specular reflectance RGB at normal incidence, GGX roughness alpha, and the
slopes dz/dx and dz/dy of the surface.
"""

from __future__ import annotations

import cv2
import numpy as np
from skimage import data as photographs

TEXEL_M = 0.001
DIFFUSE, SPECULAR, ROUGHNESS, SLOPE = slice(0, 3), slice(3, 6), 6, slice(7, 9)
CHANNELS = 9
# reflectance of evaporated metal at normal incidence, linear RGB (handbook values, rounded)
METALS = {"aluminium": (0.91, 0.92, 0.92), "gold": (1.00, 0.77, 0.34)}
# creases of film that was crushed and smoothed again: size of the facets (texels), height of their edges
CREASES_M = ((110, 0.0022), (45, 0.0014), (16, 0.0005), (8, 0.00018))
PHOTOGRAPHS = ("astronaut", "brick", "camera", "chelsea", "coffee", "coins", "grass", "gravel", "page",
               "rocket", "text", "moon")  # fmt: skip


def smooth_noise(shape, cell: float, rng) -> np.ndarray:
    """Zero-mean unit-variance noise whose features are about ``cell`` texels wide."""
    coarse = (max(int(shape[0] / cell) + 3, 4), max(int(shape[1] / cell) + 3, 4))
    grid = rng.standard_normal(coarse).astype(np.float32)
    noise = cv2.resize(grid, (shape[1], shape[0]), interpolation=cv2.INTER_CUBIC)
    return (noise - noise.mean()) / (noise.std() + 1e-9)


def texel_shape(panel_size_m) -> tuple[int, int]:
    """Rows and columns of a skin."""
    return round(panel_size_m[1] / TEXEL_M), round(panel_size_m[0] / TEXEL_M)


def film(panel_size_m, centre_m, rng, metal="aluminium", pleated=True) -> np.ndarray:
    """Metallised film glued to a board: creases at several scales, pleats around a ring at ``centre_m``."""
    shape = texel_shape(panel_size_m)
    rows, columns = np.indices(shape, np.float32)
    height_m = np.zeros(shape, np.float32)
    for cell, amplitude_m in CREASES_M:
        warp = 0.35 * cell * np.stack([smooth_noise(shape, 1.5 * cell, rng) for _ in range(2)])
        fold = 1.6 - np.abs(smooth_noise(shape, cell, rng))  # ridges where the noise changes sign
        fold = cv2.remap(fold, columns + warp[0], rows + warp[1], cv2.INTER_LINEAR,
                         borderMode=cv2.BORDER_REFLECT)  # fmt: skip
        height_m += amplitude_m * fold
    x = (columns + 0.5) * TEXEL_M - panel_size_m[0] / 2 - centre_m[0]
    y = (rows + 0.5) * TEXEL_M - panel_size_m[1] / 2 - centre_m[1]
    angle, radius = np.arctan2(y, x), np.hypot(x, y)
    turn = (angle / (2 * np.pi) % 1 * 2047).astype(np.float32)
    pleats = smooth_noise((1, 2048), rng.uniform(20, 40), rng)
    pleat = cv2.remap(pleats, turn, np.zeros_like(turn), cv2.INTER_LINEAR)
    height_m -= 0.0016 * pleated * np.abs(pleat) * np.exp(-(((radius - 0.05) / 0.09) ** 2))
    height_m = cv2.GaussianBlur(height_m, (0, 0), 0.6)
    inset = np.minimum(np.minimum(rows, rows[::-1]), np.minimum(columns, columns[:, ::-1]))
    height_m -= 0.0016 * np.clip(1 - inset / 5, 0, 1) ** 2  # folded over the board's edge

    skin = np.zeros((*shape, CHANNELS), np.float32)
    dirt = np.clip(1 + 0.15 * smooth_noise(shape, 30, rng), 0.5, 1.3)[..., None]
    skin[..., SPECULAR] = 0.85 * np.array(METALS[metal])
    skin[..., DIFFUSE] = 0.03 * np.array(METALS[metal]) * dirt
    skin[..., ROUGHNESS] = rng.uniform(0.09, 0.15) * np.clip(1 + 0.2 * smooth_noise(shape, 60, rng), 0.5, 2)
    skin[..., SLOPE] = _slopes(height_m)
    return skin


def _slopes(height_m) -> np.ndarray:
    dz_dy, dz_dx = np.gradient(height_m, TEXEL_M)
    return np.stack([dz_dx, dz_dy], -1)


def textured_cover(panel_size_m, rng) -> np.ndarray:
    """A cover that is no satellite's: layers of paint, noise, checks, stripes, photographs and blobs, of any
    gloss."""
    shape = texel_shape(panel_size_m)
    albedo = _paint(shape, rng)
    for layer in rng.choice([_noise, _checks, _photograph, _blobs, _stripes], rng.integers(1, 4)):
        paint, cover = layer(shape, rng)
        albedo = np.where(cover[..., None], paint, albedo)
    skin = np.zeros((*shape, CHANNELS), np.float32)
    skin[..., DIFFUSE] = np.clip(albedo * rng.uniform(0.4, 1.0), 0.01, 0.9)
    skin[..., SPECULAR] = rng.choice([0.04, 0.04, 0.3]) * rng.uniform(0.7, 1.0, 3)
    skin[..., ROUGHNESS] = rng.uniform(0.12, 0.6)
    waves = sum(smooth_noise(shape, cell, rng) * cell for cell in (120, 40, 15))
    skin[..., SLOPE] = _slopes(rng.uniform(0, 1.5e-5) * waves)
    return skin


def _colour(rng) -> np.ndarray:
    return rng.uniform(0.02, 0.9, 3) if rng.random() < 0.6 else np.full(3, rng.uniform(0.02, 0.9))


def _paint(shape, rng):
    return np.broadcast_to(_colour(rng), (*shape, 3))


def _patch(shape, rng) -> np.ndarray:
    """Mask of the whole panel, or of a random box of at least a ninth of it."""
    if rng.random() < 0.4:
        return np.ones(shape, bool)
    cover = np.zeros(shape, bool)
    size = [int(n * rng.uniform(1 / 3, 1)) for n in shape]
    r, c = (rng.integers(0, n - m + 1) for n, m in zip(shape, size, strict=True))
    cover[r : r + size[0], c : c + size[1]] = True
    return cover


def _noise(shape, rng):
    share = 0.5 + 0.25 * sum(smooth_noise(shape, rng.uniform(4, 120), rng) for _ in range(2))
    share = np.clip(share, 0, 1)[..., None]
    return share * _colour(rng) + (1 - share) * _colour(rng), _patch(shape, rng)


def _turned_axes(shape, rng):
    rows, columns = np.indices(shape)
    a = rng.uniform(0, np.pi)
    return rows * np.cos(a) + columns * np.sin(a), columns * np.cos(a) - rows * np.sin(a)


def _checks(shape, rng):
    u, v = _turned_axes(shape, rng)
    cell = rng.uniform(8, 60)
    odd = ((u // cell + v // cell) % 2)[..., None]
    return odd * _colour(rng) + (1 - odd) * _colour(rng), _patch(shape, rng)


def _stripes(shape, rng):
    u, _ = _turned_axes(shape, rng)
    period = rng.uniform(10, 120)
    on = (u % period < rng.uniform(0.1, 0.9) * period)[..., None]
    return on * _colour(rng) + (1 - on) * _colour(rng), _patch(shape, rng)


def _blobs(shape, rng):
    """Discs, boxes and rings: shapes that resemble a port's ring."""
    canvas = np.zeros(shape, np.uint8)
    for _ in range(rng.integers(2, 14)):
        c = tuple(int(v) for v in rng.integers(0, [shape[1], shape[0]]))
        size, width = int(rng.integers(8, 90)), int(rng.choice([-1, -1, 3, 8, 15]))
        if rng.random() < 0.7:
            cv2.circle(canvas, c, size, 1, width)
        else:
            cv2.rectangle(canvas, c, (c[0] + size, c[1] + int(rng.integers(8, 90))), 1, width)
    return np.broadcast_to(_colour(rng), (*shape, 3)), canvas > 0


def _photograph(shape, rng):
    image = getattr(photographs, str(rng.choice(PHOTOGRAPHS)))()
    image = np.atleast_3d(image)[..., :3].astype(np.float32) / 255
    image = np.broadcast_to(image, (*image.shape[:2], 3))
    image = np.ascontiguousarray(np.rot90(image, rng.integers(4)))
    linear = cv2.resize(image, (shape[1], shape[0]), interpolation=cv2.INTER_AREA) ** 2.2
    return linear, _patch(shape, rng)
