"""Compares cameras and domain gaps by equal trainings: the ring filters of both, each with three seeds.

    python tuning/training_seeds.py

The shipped filters of the two gaps had unequal trainings.  A comparison needs equal ones, and more than one
draw.  Here every filter sees as many sequences, crops and steps as the others.  All begin from chance.  They
are judged on sequences with the film that the low gap's training has and the high gap's has not; no training
and no test uses these.  A ring is right if one of its two poses is within the limits of a right pose, yaw
apart.

Weights and checkpoints are kept in data/derived, so an interrupted run goes on.  The trainings take two hours
of one processor core.  The table is data/results/equal-training.csv.
"""

from __future__ import annotations

from itertools import product
from pathlib import Path

import pandas as pd
from wrong_poses import CAMERA, EACH, LIGHTS, PORT, looks, of_light

from lmmap.evaluation.pose_errors import normal_error_rad, position_error_m
from lmmap.pipeline import circle
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.network import CHANNELS
from lmmap.pipeline.ring import binarise, find_ring
from lmmap.pipeline.weights import load_network
from lmmap.refinement.contour import Contour
from lmmap.settings import OURS
from lmmap.types import Pose
from lmmap_lab.bench import labels, sequences
from lmmap_lab.bench.renderer import ray_grid
from lmmap_lab.provenance import DATA, DERIVED_DATA, save_table
from lmmap_lab.studies.right_and_wrong import shares
from lmmap_lab.training import train
from lmmap_lab.training.mask_quality import iou
from lmmap_lab.training.recipe import FAST, Recipe

SEEDS, STEPS, CROP_PX = (0, 1, 2), 2500, 64
TRAINING = {  # as many sequences for either gap
    "high": [f"augmented-{i}" for i in range(240)],
    "low": [f"augmented-{i}" for i in range(160)] + [f"realistic-{i}" for i in range(80)],
}
FIRST, COUNT, SECONDS = 2701, 20, 0.6  # sequences that judge: the first number, how many of each light
FOLDER = DERIVED_DATA / "seeds"


def say(line: str) -> None:
    print(f"seeds: {line}", flush=True)


def trained(modality: str, gap: str, seed: int) -> Path:
    """Path of a ring filter's weights, trained where they are absent."""
    path = FOLDER / f"ring-{modality}-{gap}-{seed}.safetensors"
    if not path.exists():
        recipe = Recipe("ring", modality, gap, seed=seed, steps=STEPS, crop_px=CROP_PX, rate=FAST)
        train.train(recipe, DERIVED_DATA / "training", say, path, names=TRAINING[gap], every=500)
    return path


def judging_images() -> dict[str, list[tuple]]:
    """``(light, image, true pose)`` by camera, up to `EACH` of a sequence."""
    images = {modality: [] for modality in CHANNELS}
    for light in LIGHTS:
        for name in of_light(light, FIRST, COUNT):
            recording = sequences.simulate(name, SECONDS, setup=sequences.Setup(frame_hz=5))
            for modality, known in images.items():
                pictures, truths = looks(recording, modality)[modality]
                known += [(light, image, truth) for image, truth in zip(pictures, truths, strict=True)]
        say(f"{light} light: simulated")
    return images


def is_right(candidates: Pose, truth: Pose) -> bool:
    """Whether one of the two poses of a ring is right, yaw apart."""
    near = position_error_m(candidates, truth) < OURS.right_position_m
    return bool((near & (normal_error_rad(candidates, truth) < OURS.right_normal_rad)).any())


def judge(path: Path, modality: str, images: list[tuple]) -> pd.DataFrame:
    """A row for each light: overlap of the masks, and rings that are right, wrong and not found."""
    network, rays, rows = load_network(path, modality), ray_grid(CAMERA, 4), []
    estimator = Estimator(CAMERA, PORT, modality, (network, network))
    for light, image, truth in images:
        mask = network(image)
        ring = find_ring(mask, PORT, CAMERA, estimator.settings)
        has_ring = isinstance(ring, Contour)
        right = has_ring and is_right(circle.poses(ring.ellipse, CAMERA, PORT.ring_radius_m), truth)
        overlap = iou(binarise(mask, OURS.mask_threshold), labels.label_masks(truth, PORT, CAMERA, rays)[0])
        rows.append((light, has_ring, has_ring and not right, overlap))
    table = pd.DataFrame(rows, columns=["light", "has_ring", "wrong", "iou"])
    return pd.DataFrame([
        {"light": light, **shares(t.has_ring.to_numpy(), t.wrong.to_numpy()), "iou": t.iou.median()}
        for light, t in table.groupby("light", sort=False)
    ])  # fmt: skip


def main() -> None:
    runs = list(product(SEEDS, CHANNELS, TRAINING))
    paths = [trained(modality, gap, seed) for seed, modality, gap in runs]
    images = judging_images()
    tables = []
    for (seed, modality, gap), path in zip(runs, paths, strict=True):
        rows = judge(path, modality, images[modality])
        tables.append(rows.assign(modality=modality, domain_gap=gap, seed=seed))
        say(f"{path.stem}: judged")
    table = pd.concat(tables, ignore_index=True)
    print(table.round(2).to_string())
    facts = {"steps": STEPS, "crop_px": CROP_PX, "rate": FAST, "sequences": len(TRAINING["low"]),
             "first_sequence": FIRST, "sequences_of_each_light": COUNT, "images_each": EACH}  # fmt: skip
    save_table(DATA / "results" / "equal-training.csv", table, **facts)


if __name__ == "__main__":
    main()
