"""How often the interval of `lmmap calibrate CLIP --focal` holds the true lens, on simulated clips.

    python benchmarks/lens_coverage.py            # four clips, prints
    python benchmarks/lens_coverage.py --save     # data/results/lens.csv, two minutes

Each clip has a lens, a centre and a distortion of its own, a plate that was folded 3 % too high or too low,
30 views, a blur that differs from view to view, sRGB's gamma, noise and JPEG.  The fit begins at the poses
that a camera of 60 degrees would see, disturbed by 2 mm and 1 degree.  The networks take no part: the clips
tell about the fit alone, and about paper that lies flat.
"""

from __future__ import annotations

import argparse
import warnings
from collections import Counter
from dataclasses import replace

import cv2
import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from lmmap.geometry.port import ideal_masks, in_view
from lmmap.types import Camera, Port, Pose
from lmmap_lab.provenance import DATA, save_table
from lmmap_lab.rig.lens import INFLATION, fit_lens
from lmmap_lab.rig.port_calibration import with_lens
from lmmap_lab.rig.port_views import Views
from lmmap_readers.webcam import assumed

WIDTH, HEIGHT, VIEWS, CLIPS = 640, 480, 30, 10
FOLD, CENTRE, BRIGHT, INK = 0.03, 0.008, 0.6, 0.04
SEEN, MILLIMETRES = 1.96, 1e-3
FACING = Rotation.from_euler("x", 180, degrees=True)


def draw_lens(rng) -> Camera:
    f, k1 = rng.uniform(0.7, 1.15) * WIDTH, rng.uniform(-0.15, 0.05)
    right, down = CENTRE * WIDTH * rng.standard_normal(2)
    return Camera(WIDTH, HEIGHT, f, f, (WIDTH - 1) / 2 + right, (HEIGHT - 1) / 2 + down, (k1, 0, 0, 0))


def draw_pose(camera: Camera, port: Port, rng) -> Pose:
    """A pose with the whole ring in view, anywhere in the image."""
    while True:
        z, around = rng.uniform(0.3, 0.8) * camera.fx_px / camera.width_px, rng.uniform(0, 2 * np.pi)
        tilt = np.radians(rng.uniform(0, 50)) * np.array([np.cos(around), np.sin(around), 0])
        roll = Rotation.from_euler("z", rng.uniform(-60, 60), degrees=True)
        turn = Rotation.from_rotvec(tilt) * FACING * roll
        beside = rng.uniform(-0.5, 0.5, 2) * camera.size_px / camera.fx_px
        T = Pose(turn.as_matrix(), z * np.append(beside, 1))
        if in_view(T, port, camera):
            return T


def draw_view(camera: Camera, port: Port, rng) -> tuple[Pose, np.ndarray]:
    """A pose, and its grey image (H, W) u8."""
    T = draw_pose(camera, port, rng)
    light = INK + BRIGHT * ideal_masks(T, port, camera, samples=3).max(0)
    light = cv2.GaussianBlur(light, (0, 0), rng.uniform(0.7, 1.3))
    seen = 255 * (1.055 * light ** (1 / 2.4) - 0.055) + 2 * rng.standard_normal(light.shape)
    jpeg = cv2.imencode(".jpg", seen.clip(0, 255).astype(np.uint8), [cv2.IMWRITE_JPEG_QUALITY, 85])[1]
    return T, cv2.imdecode(jpeg, cv2.IMREAD_GRAYSCALE)


def measure(seed: int, views: int = VIEWS) -> dict:
    """True and measured lens of a clip."""
    rng, port = np.random.default_rng([97, seed]), Port.lm_map()
    height_m = port.plate_height_m * (1 + FOLD * rng.standard_normal())
    camera = draw_lens(rng)
    built = replace(port, plate_height_m=height_m)
    truth, images = zip(*(draw_view(camera, built, rng) for _ in range(views)), strict=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        start = assumed(camera.size_px, "clip")
    position = np.stack([T.position_m for T in truth]) * [1, 1, start.fx_px / camera.fx_px]
    turn = Rotation.from_rotvec(np.radians(1) * rng.standard_normal((views, 3)))
    rotation = turn.as_matrix() @ np.stack([T.rotation for T in truth])
    T = Pose(rotation, position + 2 * MILLIMETRES * rng.standard_normal(position.shape))
    fit = fit_lens(Views(T, list(images), Counter()), port, start)
    found, sigma = with_lens(start, fit.lens), INFLATION * fit.lens_sigma
    errors = np.log(found.fx_px / camera.fx_px), found.distortion[0] - camera.distortion[0]
    return {"clip": seed, "focal_px": camera.fx_px, "focal_error_percent": 100 * errors[0],
            "focal_sigma_percent": 100 * sigma[0], "k1": camera.distortion[0], "k1_error": errors[1],
            "k1_sigma": sigma[1], "agree": int(fit.kept.sum()), "settled": fit.settled}  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--save", action="store_true", help="all clips, and the committed table")
    save = parser.parse_args().save
    rows = []
    for seed in range(CLIPS if save else 4):
        rows.append(measure(seed))
        print(rows[-1], flush=True)
    table = pd.DataFrame(rows)
    for name, unit in (("focal", "_percent"), ("k1", "")):
        z = table[f"{name}_error{unit}"] / table[f"{name}_sigma{unit}"]
        inside, rms = 100 * np.mean(z.abs() < SEEN), np.sqrt((z**2).mean())
        print(f"{name}: {inside:.0f} % in the 95 % interval, root mean square {rms:.2f}")
    if save:
        save_table(DATA / "results" / "lens.csv", table, command="python benchmarks/lens_coverage.py --save",
                   inflation=INFLATION)  # fmt: skip


if __name__ == "__main__":
    main()
