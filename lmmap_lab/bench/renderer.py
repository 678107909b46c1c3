"""The bench's light: lamps and materials in, radiance at the camera out.

Radiance is in one linear unit.  Lamps are small spheres in the camera frame.  `shading` has the equations;
`optics` makes pixels of the radiance.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lmmap.geometry.projection import bearings
from lmmap.types import Camera, Pose

from .cad import Solid
from .optics import luminance
from .shading import shading_kernel

AMBIENT = 0.0018  # of the summed intensity: walls of albedo 0.05 three metres away, 0.05 / (pi 3^2)
PARTS = np.array([  # diffuse albedo, specular reflectance, GGX roughness, by the surface numbers of `cad`
    (0.00, 0.00, 0.00),  # nothing
    (0.00, 0.00, 0.00),  # panel: its skin says it
    (0.30, 0.04, 0.45),  # ring
    (0.30, 0.04, 0.45),  # marker
    (0.20, 0.25, 0.35),  # plate
    (0.08, 0.10, 0.30),  # petal
    (0.05, 0.05, 0.40),  # body
])  # fmt: skip


class Lamps(NamedTuple):
    """Lamps in the camera frame: position (L, 3) m, radiant intensity (L, colours), radius (L,) m.

    A lamp's radius widens the microfacet lobe that sees it; the shadow of one above `shading.SOFT_RADIUS_M`
    is the mean of four, from a square of half its size.
    """

    position_m: np.ndarray
    intensity: np.ndarray
    radius_m: np.ndarray


def ray_grid(camera: Camera, samples: int = 2) -> np.ndarray:
    """Unit directions of each pixel's samples on an n-rooks pattern, (samples, H, W, 3) f32."""
    rank = np.arange(samples)
    offsets = (np.stack([rank, (rank * 2 + 1) % (samples + 1 - samples % 2)], -1) + 0.5) / samples - 0.5
    v, u = np.indices((camera.height_px, camera.width_px))
    pixels = np.stack([u, v], -1) + offsets[:, None, None, :]
    rays = bearings(pixels, camera)
    return (rays / np.linalg.norm(rays, axis=-1, keepdims=True)).astype(np.float32)


def render(solid: Solid, skin, lamps: Lamps, T_cam_port: Pose, rays, backdrop, *, parts=PARTS,
           ambient: float = AMBIENT) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Radiance of the scene, and how much of each pixel shows the ring and the markers.

    Parameters
    ----------
    solid, skin : the port on its panel, and the panel's cover (`skins`)
    rays : from `ray_grid`, (samples, H, W, 3)
    backdrop : radiance (H, W, colours) where a ray hits nothing; one colour (`to_monochrome`) or three
    parts : materials of the port's parts, as `PARTS`
    ambient : light from everywhere, as a share of the lamps' summed intensity

    Returns
    -------
    radiance (H, W, colours) f32, cover (H, W, 2) f32 in [0, 1]
    """
    T_port_cam = T_cam_port.inverse
    kernel = shading_kernel(backdrop.shape[-1])
    return kernel(solid, skin, T_port_cam @ lamps.position_m, lamps.intensity, lamps.radius_m, parts,
                  T_cam_port.rotation, T_port_cam.position_m, rays, backdrop,
                  ambient * lamps.intensity.sum(0))  # fmt: skip


def to_monochrome(skin, lamps: Lamps, backdrop):
    """Skin, lamps and backdrop in the one colour of a pixel without filter, for one ray a pixel.

    Such a ray would alias: the skin is averaged over 2 x 2 texels, about a pixel at mid-range, and what
    slopes that takes away widens the microfacet lobe, alpha^2 + 2 var(slope).
    """
    mono = np.concatenate([luminance(skin[..., 0:3]), luminance(skin[..., 3:6]), skin[..., 6:]], -1)
    rows, columns = len(mono) // 2, mono.shape[1] // 2
    blocks = mono[: 2 * rows, : 2 * columns].reshape(rows, 2, columns, 2, 5)
    blocks = blocks.transpose(0, 2, 1, 3, 4).reshape(rows, columns, 4, 5)
    small = blocks.mean(2)
    small[..., 2] = np.sqrt(small[..., 2] ** 2 + 2 * blocks[..., 3:].var(2).mean(-1)).clip(max=1)
    lamps = lamps._replace(intensity=luminance(lamps.intensity))
    return small.astype(np.float32), lamps, np.ascontiguousarray(luminance(backdrop))
