"""A paper port before photographs, beside cups, clocks, plates and rolls of tape: right, wrong, none.

    python benchmarks/living_room.py --poses 3 --circles 5      # a few images of each scene, prints
    python benchmarks/living_room.py --save                     # data/results/paper-port.csv, ten minutes

Twenty scenes, each with a photograph, camera, light and clutter of its own.  In each a folded port of paper
is drawn at random poses, often with fingers over its rim, next to printed circles that are none.  Besides,
1,000 images show such circles alone.  The photographs are those that the wheels of scikit-image and
matplotlib carry; nothing in lmmap was chosen on these scenes.  The networks have the command's precision.
"""

from __future__ import annotations

import argparse
from collections import Counter
from importlib.resources import files

import cv2
import numpy as np
import pandas as pd
import torch
from joblib import Parallel, delayed
from paper_scene import PORT, SUPER, decoy, fingers, paper_port
from scipy.spatial.transform import Rotation

from lmmap.evaluation.pose_errors import position_error_m
from lmmap.geometry.port import in_view
from lmmap.geometry.projection import project
from lmmap.pipeline.agreement import alike
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.network import faster_precision
from lmmap.settings import OURS
from lmmap.types import Camera, Pose
from lmmap_lab.provenance import DATA, save_table
from lmmap_lab.studies.networks import set_hashes

SKIMAGE = ("astronaut.png", "brick.png", "cell.png", "chelsea.png", "clock_motion.png", "coffee.png",
           "coins.png", "color.png", "grass.png", "gravel.png", "horse.png", "hubble_deep_field.jpg",
           "ihc.png", "moon.png", "motorcycle_left.png", "page.png", "retina.jpg", "rocket.jpg",
           "text.png")  # fmt: skip
SCENES = (*SKIMAGE, "grace_hopper.jpg")
POSES, CIRCLES = 15, 50  # of a scene: images with a port, and with circles alone
LARGEST = 6  # decoys in an image, at most
FACING = Rotation.from_euler("x", 180, degrees=True)


def photograph(name: str) -> np.ndarray:
    """A picture (H, W, 3) u8 RGB of one of the wheels."""
    wheel, place = ("skimage", "data") if name in SKIMAGE else ("matplotlib", "mpl-data/sample_data")
    folder = files(wheel).joinpath(*place.split("/"))
    return cv2.imdecode(np.frombuffer((folder / name).read_bytes(), np.uint8), cv2.IMREAD_COLOR_RGB)


class Scene:
    """A photograph, a camera before it, its light and its faults."""

    def __init__(self, number: int):
        self.rng = rng = np.random.default_rng([72, number])
        self.name = SCENES[number]
        f = 320 / np.tan(np.radians(rng.uniform(50, 75)) / 2)
        k1 = rng.uniform(-0.15, 0.05)
        self.camera = Camera(640, 480, f, f, rng.normal(319.5, 4), rng.normal(239.5, 4), (k1, 0, 0, 0))
        side = Rotation.from_euler("yx", [rng.uniform(-70, 70), rng.uniform(-30, 60)], degrees=True)
        self.light = {"from": -side.apply([0, 0, 1.0]), "card": rng.uniform(0.2, 0.8, 3),
                      "colour": rng.uniform(140, 330) * rng.uniform(0.85, 1, 3)}  # fmt: skip
        self.blur, self.noise = rng.uniform(0.4, 1.4), rng.uniform(1, 5)
        self.quality = int(rng.integers(60, 95))
        self.ink = rng.uniform(0.03, 0.10)

    def background(self) -> np.ndarray:
        """A part of the photograph, at least three fifths of it wide, brighter or darker."""
        picture, rng = photograph(self.name), self.rng
        h, w = picture.shape[:2]
        width = rng.uniform(0.6, 1) * min(w, h * 4 / 3)
        u, v = rng.uniform(0, w - width), rng.uniform(0, h - 0.75 * width)
        part = picture[int(v) : int(v + 0.75 * width), int(u) : int(u + width)]
        shown = cv2.resize(part, (SUPER * 640, SUPER * 480), interpolation=cv2.INTER_AREA)
        return np.ascontiguousarray(shown * rng.uniform(0.5, 1.1), np.float32)

    def pose(self) -> Pose:
        """The whole ring is in view; 0.3 to 1 m away, tilted up to 55 degrees."""
        rng = self.rng
        while True:
            around = rng.uniform(0, 2 * np.pi)
            tilt = np.radians(rng.uniform(0, 55)) * np.array([np.cos(around), np.sin(around), 0])
            roll = Rotation.from_euler("z", rng.uniform(-180, 180), degrees=True)
            turn, z = Rotation.from_rotvec(tilt) * FACING * roll, rng.uniform(0.3, 1.0)
            beside = rng.uniform(-0.5, 0.5, 2) * [640, 480] / self.camera.fx_px
            T = Pose(turn.as_matrix(), z * np.append(beside, 1))
            if in_view(T, PORT, self.camera):
                return T

    def clutter(self, image, least: int, T: Pose | None = None) -> Counter:
        """Decoys beside the port."""
        kinds, rng = Counter(), self.rng
        own = None if T is None else project(T.position_m, self.camera)
        own_px = 0 if T is None else 1.6 * self.camera.fx_px * PORT.ring_outer_radius_m / T.position_m[2]
        while kinds.total() < rng.integers(least, LARGEST):
            centre, radius = rng.uniform([0, 0], [640, 480]), rng.uniform(20, 170)
            if own is None or np.linalg.norm(centre - own) > own_px + radius:
                kinds[decoy(image, centre, radius, rng)] += 1
            elif rng.random() < 0.2:
                break
        return kinds

    def frame(self, image) -> np.ndarray:
        """What the camera makes of it, (H, W, 3) u8."""
        small = cv2.resize(image, (640, 480), interpolation=cv2.INTER_AREA)
        seen = cv2.GaussianBlur(small, (0, 0), self.blur) + self.noise * self.rng.standard_normal(small.shape)
        options = [cv2.IMWRITE_JPEG_QUALITY, self.quality]
        jpeg = cv2.imencode(".jpg", seen.clip(0, 255).astype(np.uint8)[..., ::-1], options)[1]
        return cv2.imdecode(jpeg, cv2.IMREAD_COLOR_RGB)

    def with_port(self) -> tuple[np.ndarray, Pose]:
        image, T = self.background(), self.pose()
        self.clutter(image, 0, T)
        paper_port(image, T, self.camera, self.light, self.ink)
        if self.rng.random() < 0.7:
            fingers(image, T, self.camera, self.rng)
        return self.frame(image), T

    def with_circles(self) -> np.ndarray:
        image = self.background()
        self.clutter(image, 1)
        return self.frame(image)


def judge(number: int, poses: int, circles: int) -> dict:
    """A row of the table: what came of a scene's images."""
    scene = Scene(number)
    torch.set_num_threads(1)
    estimator = Estimator(scene.camera, PORT, "rgb", precision=faster_precision())
    said, errors_mm = Counter(), []
    for _ in range(poses):
        frame, truth = scene.with_port()
        T = estimator(frame).T_cam_port
        said["none" if T is None else "right" if alike(T, truth, PORT, OURS) else "wrong"] += 1
        if T is not None:
            errors_mm.append(1e3 * float(position_error_m(T, truth)))
    found = sum(estimator(scene.with_circles()).T_cam_port is not None for _ in range(circles))
    return {"scene": scene.name, "images": poses, **{what: said[what] for what in ("right", "wrong", "none")},
            "position_median_mm": float(np.median(errors_mm)) if errors_mm else np.nan,
            "circles": circles, "poses_of_circles": found}  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--save", action="store_true", help="write the committed table")
    parser.add_argument("--poses", type=int, default=POSES, help="images of each scene with a port")
    parser.add_argument("--circles", type=int, default=CIRCLES, help="images of each with circles alone")
    parser.add_argument("--jobs", type=int, default=1, help="scenes at once")
    a = parser.parse_args()
    rows = []
    work = (delayed(judge)(number, a.poses, a.circles) for number in range(len(SCENES)))
    for row in Parallel(a.jobs, return_as="generator", batch_size=1)(work):
        rows.append(row)
        print(row, flush=True)
    table = pd.DataFrame(rows)
    print(table.sum(numeric_only=True).to_string())
    if a.save:
        command = f"python benchmarks/living_room.py --save --poses {a.poses} --circles {a.circles}"
        networks = {"networks": set_hashes(OURS.weights), "computed_in": faster_precision()}
        save_table(DATA / "results" / "paper-port.csv", table, command=command, **networks)


if __name__ == "__main__":
    main()
