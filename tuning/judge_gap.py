"""Judges what a domain gap costs frames and events, by networks whose trainings were equal.

    python tuning/judge_gap.py

The rings of the sets *low* and *high* were trained for as many steps as each other, with three seeds each; of
markers there is one seed.  The weights of the further seeds are in the history: before this script,

    git restore --source bc41056 -- 'data/weights/*-seed?.safetensors'

or train them again by the commands in their model cards.  The networks look at film that only *low* was
trained on, and at the second simulated scene (`validation_world`), whose materials neither was trained on.
*robust* looks at both, with its one seed.  No training, choice or test uses these sequences.  Measured are
the overlap of the ring's mask with the true one, rings (one of the two circles is right, yaw apart) and
poses, by one look at each image.  No confidence is asked for: its limits were chosen for other networks.

What each image gave is kept in data/derived/gap, so an interrupted run goes on; remove that folder after a
change of the bench, the estimator or the weights.  The table is data/results/domain-gap.csv.  It takes a
quarter of an hour of one processor core.
"""

from __future__ import annotations

from dataclasses import replace

import pandas as pd
import torch
import validation_world as world
from choose_thresholds import right
from judged_images import CAMERA, LIGHTS, PORT, of_light

from lmmap.evaluation.pose_errors import normal_error_rad, position_error_m
from lmmap.pipeline import circle
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.network import CHANNELS
from lmmap.pipeline.ring import binarise
from lmmap.pipeline.weights import load_network, weight_path
from lmmap.settings import OURS, PerCamera
from lmmap.types import Pose, Recording
from lmmap_lab.bench import labels, sequences
from lmmap_lab.bench.renderer import ray_grid
from lmmap_lab.provenance import DATA, DERIVED_DATA, save_table
from lmmap_lab.studies import domain_gap
from lmmap_lab.studies.networks import set_hashes
from lmmap_lab.training.mask_quality import images_in_view, iou

SEEDS = {"high": (0, 1, 2), "low": (0, 1, 2), "robust": (0,)}
PLACES = {"film": (2701, 8, 5), "second scene": (2731, 8, 3)}  # first number, sequences a light, images each
SEQUENCES = {place: {name: light for light in LIGHTS for name in of_light(light, first, count)}
             for place, (first, count, _) in PLACES.items()}  # fmt: skip
SECONDS = 2.0
SETTINGS = replace(OURS, turned_look=False, min_confidence=PerCamera(0.0, 0.0))
FOLDER = DERIVED_DATA / "gap"
COLUMNS = ["place", "light", "sequence", "modality", "set", "seed", "t_us", *domain_gap.MEASURES]


def recorded(place: str, name: str) -> Recording:
    """A recording of a place; in the second scene its worlds take turns."""
    if place == "film":
        return sequences.simulate(name, SECONDS, setup=sequences.Setup(frame_hz=5))
    gap_m, sensor = world.of_turn(name)
    setup = replace(world.other_setup(gap_m), frame_hz=5)
    return sequences.simulate(name, SECONDS, sensor=sensor, setup=setup)


def is_right(candidates: Pose, truth: Pose) -> bool:
    """Whether one of the poses of a ring is right, yaw apart."""
    near = position_error_m(candidates, truth) < OURS.right_position_m
    return bool((near & (normal_error_rad(candidates, truth) < OURS.right_normal_rad)).any())


def judge(image, truth: Pose, true_ring, modality: str, ring, reflectors) -> tuple:
    """`domain_gap.MEASURES` of an image by a ring's and a markers' network."""
    mask = ring(image)
    estimate = Estimator(CAMERA, PORT, modality, (lambda _: mask, reflectors), SETTINGS).on_grid(image)
    T, ellipse = estimate.T_cam_port, estimate.ellipse
    found = ellipse is not None and is_right(circle.poses(ellipse, CAMERA, PORT.ring_radius_m), truth)
    good = T is not None and right(T, truth, PORT)
    overlap = iou(binarise(mask, OURS.mask_threshold), true_ring)
    return overlap, found, good, T is not None and not good


def of_sequence(place: str, name: str, light: str, networks: dict) -> pd.DataFrame:
    """A row an image and network; kept."""
    kept = FOLDER / f"{name}.csv"
    if kept.exists():
        return pd.read_csv(kept)
    recording, rays, rows = recorded(place, name), ray_grid(CAMERA, 4), []
    for modality in CHANNELS:
        for t_us, image, truth in images_in_view(recording, modality, PORT, OURS, PLACES[place][2]):
            true_ring = labels.label_masks(truth, PORT, CAMERA, rays)[0]
            for (m, gap, seed), pair in networks.items():
                if m == modality:
                    of_image = judge(image, truth, true_ring, modality, *pair)
                    rows.append([place, light, name, modality, gap, seed, t_us, *of_image])
    FOLDER.mkdir(parents=True, exist_ok=True)
    table = pd.DataFrame(rows, columns=COLUMNS)
    table.to_csv(kept, index=False)
    return table


def main() -> None:
    torch.set_num_threads(1)
    networks = {
        (m, gap, seed): [load_network(weight_path("ring", m, gap, seed), m),
                         load_network(weight_path("reflector", m, gap), m)]
        for m in CHANNELS for gap, seeds in SEEDS.items() for seed in seeds
    }  # fmt: skip
    tables = []
    for place, names in SEQUENCES.items():
        for name, light in names.items():
            tables.append(of_sequence(place, name, light, networks))
            print(f"gap: {place}: {name}, {light} light", flush=True)
    images = pd.concat([t for t in tables if len(t)], ignore_index=True)
    once = images.query("set == 'robust'").groupby(["place", "light", "modality"], sort=False)
    of_each = {" ".join(cell): len(group) for cell, group in once}
    table = domain_gap.table(images)
    print(table.query("measure != 'pose_wrong'").round(3).to_string(), of_each)
    save_table(DATA / "results" / "domain-gap.csv", table, images=of_each, sequences=SEQUENCES,
               networks={gap: set_hashes(gap) for gap in SEEDS},
               seeds={gap: len(seeds) for gap, seeds in SEEDS.items()}, draws=domain_gap.DRAWS)  # fmt: skip


if __name__ == "__main__":
    main()
