"""The bench's scene in Mitsuba 3: its shapes (`mitsuba_shapes`), lamps and rays.

Each layer of a material has its own scene.  Every sample goes through its pixel's centre, so that no filter
hides a difference; a finer camera samples finer.  The scene has no ambient light.
"""

from __future__ import annotations

import cv2
import numpy as np
from mitsuba_shapes import mi, rgb, shapes

from lmmap_lab.bench.cad import BODY, MARKER, PANEL, PETAL, PLATE, RING

LAYERS = ("diffuse", "microfacet", "retro")
SURFACE = {"panel face": PANEL, "panel": PANEL, "ring": RING, "outer wall": BODY, "inner wall": BODY,
           "stem": BODY, "plate": PLATE, "marker": MARKER, "petal": PETAL}  # fmt: skip


def scene(solid, skin, layer, emitters, integrator, T_cam_port, camera, samples=1, jitter=False) -> mi.Scene:
    """The bench as Mitsuba sees it; ``camera`` must be centred and undistorted, with square pixels."""
    centre = (np.array(camera.size_px) - 1) / 2
    if camera.distortion or camera.fx_px != camera.fy_px or np.any(centre != camera.K[:2, 2]):
        raise ValueError(f"scene: camera must be centred, undistorted, of square pixels, got {camera}")
    to_world = np.eye(4)
    to_world[:3, :3] = T_cam_port.inverse.rotation @ np.diag([-1, -1, 1])  # Mitsuba's x is left, y is up
    to_world[:3, 3] = T_cam_port.inverse.position_m
    sensor = {
        "type": "perspective",
        "fov": float(2 * np.rad2deg(np.arctan(camera.width_px / (2 * camera.fx_px)))),
        "fov_axis": "x",
        "near_clip": 1e-3,
        "to_world": mi.ScalarTransform4f(to_world),
        "film": {
            "type": "hdrfilm",
            "width": camera.width_px,
            "height": camera.height_px,
            "pixel_format": "rgb",
            "component_format": "float32",
            "rfilter": {"type": "box"},
        },
        "sampler": {"type": "stratified", "sample_count": samples, "jitter": jitter},
    }  # fmt: skip
    lights = {f"lamp {i}": emitter for i, emitter in enumerate(emitters)}
    return mi.load_dict(
        {"type": "scene", "integrator": integrator, "sensor": sensor, **lights, **shapes(solid, skin, layer)}
    )


def points(lamps, T_cam_port) -> list[dict]:
    """Lamps without a size."""
    positions = T_cam_port.inverse @ lamps.position_m
    return [
        {"type": "point", "position": [float(v) for v in p], "intensity": rgb(i)}
        for p, i in zip(positions, lamps.intensity, strict=True)
    ]


def spheres(lamps, T_cam_port) -> list[dict]:
    """Lamps as glowing spheres of their own radius: radiance = intensity / (pi radius^2)."""
    positions = T_cam_port.inverse @ lamps.position_m
    return [
        {"type": "sphere", "center": [float(v) for v in p], "radius": float(r),
         "emitter": {"type": "area", "radiance": rgb(i / (np.pi * r * r))}}
        for p, i, r in zip(positions, lamps.intensity, lamps.radius_m, strict=True)
    ]  # fmt: skip


def direct(samples=1) -> dict:
    return {"type": "direct", "emitter_samples": samples, "bsdf_samples": 0, "hide_emitters": True}


def render(solid, skin, emitters, T_cam_port, camera, layers=LAYERS) -> np.ndarray:
    """Radiance (H, W, 3) under lamps that are points: one ray a pixel, the sum over lamps and layers."""
    total = np.zeros((camera.height_px, camera.width_px, 3))
    for layer in layers:
        for lamp in emitters:
            total += mi.render(scene(solid, skin, layer, [lamp], direct(), T_cam_port, camera))
    return total


def surfaces(solid, skin, T_cam_port, camera) -> np.ndarray:
    """The surface at each pixel's centre, (H, W), by the numbers of `lmmap_lab.bench.cad`."""
    aov = {"type": "aov", "aovs": "what:shape_index"}
    seen = scene(solid, skin, "diffuse", [], aov, T_cam_port, camera)
    index = np.array(mi.render(seen))[..., -1].round().astype(int)
    number = [SURFACE.get(s.id(), SURFACE.get(s.id().rsplit(" ", 1)[0])) for s in seen.shapes()]
    return np.array([0, *number])[index]


def disagreement(ours, theirs, seen) -> tuple[float, float]:
    """Median and 95th percentile of the relative difference of luminance over lit pixels of the panel and
    the port, one-pixel edges between surfaces left out."""
    rec709 = np.array([0.2126, 0.7152, 0.0722])
    a, b = (image[..., 0] if image.shape[-1] == 1 else image @ rec709 for image in (ours, theirs))
    seen = seen.astype(np.uint8)
    edge = cv2.dilate(seen, np.ones((3, 3))) != cv2.erode(seen, np.ones((3, 3)))
    lit = (b > 0) & (seen > 0) & ~edge
    median, p95 = np.percentile(np.abs(a[lit] - b[lit]) / b[lit], [50, 95])
    return float(median), float(p95)
