"""The bench's renderer against Mitsuba 3, a path tracer by others: do both see the same light, and how fast?

    python benchmarks/bench_mitsuba.py            # a few minutes; writes data/results/mitsuba.csv and .json

Both render six poses of the test trajectory under each of its three lights.  With lamps as points both use
one ray through each pixel's centre, so that a difference is one of geometry, material or light.  With lamps
as spheres Mitsuba samples their surfaces, which shows the error of our widened lobes and sharper shadows.
Last come effects that our equations leave out: light between surfaces, and a true ambient hemisphere.
"""

from __future__ import annotations

import time
from importlib.metadata import version

import cv2
import mitsuba_scene as peer
import numpy as np
import pandas as pd

from lmmap.geometry.port import in_view
from lmmap.types import Camera, Port
from lmmap_lab import provenance
from lmmap_lab.bench import cad, laboratory, renderer, sequences
from lmmap_lab.training.mask_quality import iou

mi = peer.mi
CAMERA, PORT = Camera.davis346(), Port.lm_map()
LIGHTS, POSES = ("low", "medium", "high"), 6
COMMAND = "python benchmarks/bench_mitsuba.py"
COLUMNS = ["check", "light", "t_s", "median_pct", "p95_pct", "ring_iou", "marker_iou"]


def finer(camera: Camera, factor: int) -> Camera:
    """The same view with ``factor`` x ``factor`` pixels for each."""
    cx, cy = ((c + 0.5) * factor - 0.5 for c in (camera.cx_px, camera.cy_px))
    return Camera(camera.width_px * factor, camera.height_px * factor, camera.fx_px * factor,
                  camera.fy_px * factor, cx, cy)  # fmt: skip


def ours(solid, skin, lamps, T_cam_port, camera, rays=1, mono=False, ambient=0.0):
    """Radiance and cover of our renderer in the dark room that Mitsuba's scene has."""
    black = np.zeros((camera.height_px, camera.width_px, 3), np.float32)
    if mono:
        skin, lamps, black = renderer.to_monochrome(skin, lamps, black)
    rays = renderer.ray_grid(camera, rays)
    return renderer.render(solid, skin, lamps, T_cam_port, rays, black, ambient=ambient)


def coarse(image, factor: int):
    """Means over ``factor`` x ``factor`` pixels."""
    size = (image.shape[1] // factor, image.shape[0] // factor)
    return cv2.resize(np.asarray(image, np.float64), size, interpolation=cv2.INTER_AREA)


def test_poses():
    """Times and poses, evenly spread over the part of the test trajectory that shows the whole ring."""
    t_s = np.arange(0, 210, 0.5)
    poses = laboratory.sequence_motion(laboratory.sequence("test-low"), t_s)
    seen = np.flatnonzero(in_view(poses, PORT, CAMERA))
    chosen = seen[np.linspace(0, len(seen) - 1, POSES).astype(int)]
    return [(float(t_s[i]), poses[i]) for i in chosen]


def world(light):
    seq = laboratory.sequence(f"test-{light}")
    return (*laboratory.panel(seq, PORT), laboratory.lamps(seq))


def equal_light() -> pd.DataFrame:
    """One row a light and pose: lamps as points, the same rays."""
    rows = []
    for light in LIGHTS:
        solid, skin, lamps = world(light)
        lamps = lamps._replace(radius_m=0 * lamps.radius_m)
        for t_s, T in test_poses():
            mine, cover = ours(solid, skin, lamps, T, CAMERA)
            theirs = peer.render(solid, skin, peer.points(lamps, T), T, CAMERA)
            seen = peer.surfaces(solid, skin, T, CAMERA)
            median, p95 = peer.disagreement(mine, theirs, seen)
            ring, marker = (iou(cover[..., i] > 0.5, seen == n)
                            for i, n in enumerate((cad.RING, cad.MARKER)))  # fmt: skip
            rows.append(("same rays", light, t_s, 100 * median, 100 * p95, ring, marker))
    return pd.DataFrame(rows, columns=COLUMNS)


def sized_lamps(samples=36, factor=4) -> pd.DataFrame:
    """Three rows a light and pose: lamps as spheres that Mitsuba samples, beside our rendering with many
    rays, with those of a frame, and with the one ray of the event sensor."""
    rows = []
    for light in LIGHTS:
        solid, skin, lamps = world(light)
        for t_s, T in test_poses()[::2]:
            theirs = sum(
                np.array(mi.render(peer.scene(solid, skin, layer, [lamp], peer.direct(), T, CAMERA, n, True)))
                for layer, n in zip(peer.LAYERS, (samples, samples, samples // 4), strict=True)
                for lamp in peer.spheres(lamps, T)
            )
            seen = peer.surfaces(solid, skin, T, CAMERA)
            mine = {
                "lamps with a size": coarse(ours(solid, skin, lamps, T, finer(CAMERA, factor))[0], factor),
                "as in frames": ours(solid, skin, lamps, T, CAMERA, sequences.SUB_EXPOSURES)[0],
                "as for events": ours(solid, skin, lamps, T, CAMERA, mono=True)[0],
            }
            for check, image in mine.items():
                median, p95 = peer.disagreement(image, theirs, seen)
                rows.append((check, light, t_s, 100 * median, 100 * p95, np.nan, np.nan))
    return pd.DataFrame(rows, columns=COLUMNS)


def left_out(samples=64, factor=2) -> dict:
    """Percent that light between surfaces adds, and that the ambient term exceeds a true hemisphere."""
    added, ambient = [], []
    path = {"type": "path", "max_depth": 3, "hide_emitters": True}
    for light in LIGHTS:
        solid, skin, lamps = world(light)
        bright = lamps._replace(radius_m=0 * lamps.radius_m, intensity=2 * lamps.intensity)
        for _, T in test_poses()[::2]:
            seen = peer.surfaces(solid, skin, T, CAMERA)
            view = (T, CAMERA, samples, True)
            once, twice = (
                np.array(mi.render(peer.scene(solid, skin, "half", peer.points(bright, T), how, *view)))
                for how in ({**path, "max_depth": 2}, path)
            )
            # half the reflectance under twice the light: one bounce is whole, the second is half
            second = 2 * (twice - once)[seen > 0].sum(0)
            added.append(100 * float(second.sum() / once[seen > 0].sum()))
    none = lamps._replace(position_m=np.zeros((1, 3)), intensity=np.full((1, 3), 1e-12), radius_m=np.zeros(1))
    for _, T in test_poses():
        seen = peer.surfaces(solid, skin, T, CAMERA)
        dome = [{"type": "constant", "radiance": peer.rgb(1.0)}]
        how = {"type": "direct", "emitter_samples": 2, "bsdf_samples": 2, "hide_emitters": True}
        theirs = sum(
            np.array(mi.render(peer.scene(solid, skin, layer, dome, how, T, CAMERA, samples, True)))
            for layer in peer.LAYERS[:2]
        )
        mine = coarse(ours(solid, skin, none, T, finer(CAMERA, factor), ambient=1e12)[0], factor)
        ambient.append(100 * float(mine[seen > 0].sum() / theirs[seen > 0].sum() - 1))
    return {
        "second_bounce_pct": float(np.median(added)),
        "second_bounce_worst_pct": max(added),
        "ambient_excess_pct": float(np.median(ambient)),
        "ambient_excess_worst_pct": max(ambient),
    }


def speed(repeats=9) -> dict:
    """Median milliseconds, interleaved: Mitsuba on all threads, ours on one with the rays of a frame, of an
    event image, and with as many as Mitsuba."""
    solid, skin, lamps = world("medium")
    T, black = test_poses()[0][1], np.zeros((CAMERA.height_px, CAMERA.width_px, 3), np.float32)
    room = peer.scene(solid, skin, "half", peer.spheres(lamps, T), peer.direct(), T, CAMERA, 16, True)
    grids = {n: renderer.ray_grid(CAMERA, n) for n in (1, sequences.SUB_EXPOSURES, 16)}
    colour, mono = (skin, lamps, black), renderer.to_monochrome(skin, lamps, black)

    def render(look, rays):
        return renderer.render(solid, look[0], look[1], T, grids[rays], look[2])

    timed = {
        "mitsuba_16_ms": lambda: np.array(mi.render(room)),
        "frame_ms": lambda: render(colour, sequences.SUB_EXPOSURES),
        "event_image_ms": lambda: render(mono, 1),
        "ours_16_ms": lambda: render(colour, 16),
    }
    walls = {name: [] for name in timed}
    for repeat in range(repeats + 1):
        for name, function in timed.items():
            start = time.perf_counter()
            function()
            if repeat:  # the first call compiles
                walls[name].append(1e3 * (time.perf_counter() - start))
    return {name: float(np.median(wall)) for name, wall in walls.items()}


def main() -> None:
    start = time.perf_counter()
    table = pd.concat([equal_light(), sized_lamps()], ignore_index=True)
    numbers = {**left_out(), **speed()}
    facts = {"command": COMMAND, "mitsuba": version("mitsuba")}
    folder = provenance.DATA / "results"
    provenance.save_table(folder / "mitsuba.csv", table, **facts)
    provenance.save_json(folder / "mitsuba.json", numbers, **facts)
    print(table.groupby(["check", "light"])[COLUMNS[3:]].agg(["median", "max", "min"]).round(3).to_string())
    for name, value in numbers.items():
        print(f"{value:10.2f}  {name}")
    for name in ("frame_ms", "event_image_ms", "ours_16_ms"):
        print(f"{numbers['mitsuba_16_ms'] / numbers[name]:10.1f}  mitsuba_16_ms / {name}")
    print(f"took {time.perf_counter() - start:.0f} s")


if __name__ == "__main__":
    main()
