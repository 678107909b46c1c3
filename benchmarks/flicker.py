"""Lamps on mains power and an event camera: does light that flickers at 100 Hz make wrong poses?

    python benchmarks/flicker.py            # one scene, prints
    python benchmarks/flicker.py --save     # data/results/flicker.csv, two minutes

The bench's event sensor looks at the paper port of `living_room.py`, waved before a photograph, at 1,000
images a second.  Light is 1 + m sin(2 pi 100 t): m = 0 is daylight, 0.05 to 0.3 are bulbs, 1 is a bare LED.
"""

from __future__ import annotations

import argparse
from collections import Counter

import cv2
import living_room
import numpy as np
import pandas as pd
import torch
from paper_scene import PORT, SUPER, paper_port
from scipy.spatial.transform import Rotation

from lmmap.estimation.estimates import estimate_images
from lmmap.estimation.images import TimedImage
from lmmap.pipeline.agreement import alike
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.histograms import window_histograms
from lmmap.pipeline.network import faster_precision
from lmmap.settings import OURS
from lmmap.types import EVENT, Camera, Pose
from lmmap_lab.bench.event_sensor import EventSensor, SensorSettings
from lmmap_lab.provenance import DATA, save_table
from lmmap_lab.studies.networks import set_hashes

DEPTHS, HZ, IMAGES_HZ, SECONDS, LOOK_S = (0.0, 0.05, 0.1, 0.3, 1.0), 100.0, 1000, 0.3, 0.02
SCENES = (3, 17)
CAMERA = Camera.davis346()
KEPT = 3 * OURS.events_per_window  # of the newest events: enough for both looks


def pose(t_s: float, scene: int) -> Pose:
    """A port that is waved: twice a second to and fro, by 4 cm and 10 degrees."""
    s = 4 * np.pi * t_s + scene
    turn = Rotation.from_euler("xyz", [10 * np.sin(s), 25 + 10 * np.cos(s), 10 * np.sin(s)], degrees=True)
    position = [0.04 * np.sin(s), 0.03 * np.cos(s), 0.55 + 0.03 * np.sin(s)]
    return Pose((turn * living_room.FACING).as_matrix(), position)


def light(scene: living_room.Scene, background, T: Pose) -> np.ndarray:
    """Grey image (H, W) in 8-bit units, of steady light."""
    image = background.copy()
    paper_port(image, T, CAMERA, scene.light, scene.ink)
    small = cv2.resize(image, CAMERA.size_px, interpolation=cv2.INTER_AREA)
    return cv2.GaussianBlur(small @ np.array([0.2126, 0.7152, 0.0722], np.float32), (0, 0), 0.6)


def looks(number: int) -> dict[float, list[TimedImage]]:
    """Histograms at `LOOK_S`, for each of `DEPTHS`."""
    scene, rng = living_room.Scene(number), np.random.default_rng(number)
    size = tuple(SUPER * side for side in CAMERA.size_px)
    background = cv2.resize(scene.background(), size, interpolation=cv2.INTER_AREA)
    sensors = {m: EventSensor(CAMERA, SensorSettings(), np.random.default_rng(number)) for m in DEPTHS}
    recent = {m: np.zeros(0, EVENT) for m in DEPTHS}
    found, due_s, phase = {m: [] for m in DEPTHS}, LOOK_S, rng.uniform(0, 2 * np.pi)
    for k in range(round(SECONDS * IMAGES_HZ)):
        t_s = k / IMAGES_HZ
        steady = light(scene, background, pose(t_s, number))
        for m, sensor in sensors.items():
            come = sensor(steady * (1 + m * np.sin(2 * np.pi * HZ * t_s + phase)), round(1e6 * t_s))
            recent[m] = np.concatenate([recent[m], come])[-KEPT:]
            if t_s >= due_s and len(recent[m]) >= OURS.events_per_window:
                first, *wider = window_histograms(recent[m], OURS.events_per_window, CAMERA.size_px, None)
                found[m].append(TimedImage(*first, *wider))
        due_s += LOOK_S * (t_s >= due_s)
    return found


def judge(number: int) -> list[dict]:
    """A row for each depth: what came of a scene's histograms."""
    torch.set_num_threads(1)
    estimator, rows = Estimator(CAMERA, PORT, "event", precision=faster_precision()), []
    for m, timed in looks(number).items():
        said = Counter()
        for _, e in estimate_images(timed, estimator):
            truth = pose(1e-6 * e.t_us, number)
            right = e.T_cam_port is not None and alike(e.T_cam_port, truth, PORT, OURS)
            said["none" if e.T_cam_port is None else "right" if right else "wrong"] += 1
        rows.append({"scene": living_room.SCENES[number], "depth": m, "images": len(timed),
                     **{what: said[what] for what in ("right", "wrong", "none")}})  # fmt: skip
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--save", action="store_true", help="all scenes, and the committed table")
    save = parser.parse_args().save
    rows = []
    for number in SCENES if save else SCENES[:1]:
        rows += judge(number)
        print(pd.DataFrame(rows[-len(DEPTHS) :]).to_string(), flush=True)
    table = pd.DataFrame(rows)
    print(table.groupby("depth").sum(numeric_only=True))
    if save:
        command = "python benchmarks/flicker.py --save"
        networks = {"networks": set_hashes(OURS.weights), "computed_in": faster_precision()}
        save_table(DATA / "results" / "flicker.csv", table, command=command, **networks)


if __name__ == "__main__":
    main()
