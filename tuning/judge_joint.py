"""Judges one network with both masks beside the two of the set *slim*: masks, poses, time (chooses nothing).

    python tuning/judge_joint.py FOLDER

FOLDER holds what ``train_widths.py`` writes.  The images are `judged_images` of the tuning sequences, the
settings those of the *robust* networks.  Parameters, arithmetic and time are of both masks of an image of a
DAVIS 346, on one core, the sets in turns.  The table is data/results/joint.csv.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import joblib
import judged_images
import numpy as np
import pandas as pd
import torch
from judge_widths import PLACES, ROUNDS, cost, judged, shares

from lmmap.pipeline.joint_network import common, join, mask_networks
from lmmap.pipeline.network import CHANNELS
from lmmap.pipeline.weights import FILTERS, load_filter, weight_path
from lmmap_lab.provenance import DATA, save_table


def filters_of(pattern: str, modality: str) -> list:
    return [load_filter(pattern.format(name, modality), modality) for name in FILTERS]


def milliseconds(patterns: dict[str, str], modality: str) -> dict[str, float]:
    """Median time of both masks of an image."""
    size_px, took = judged_images.CAMERA.size_px[::-1], {name: [] for name in patterns}
    image = np.zeros((*size_px, 3) if modality == "rgb" else size_px, np.uint8)
    masks = {k: mask_networks(filters_of(p, modality), modality, "float32") for k, p in patterns.items()}
    for _, (name, networks) in product(range(ROUNDS), masks.items()):
        joint = common(*networks)
        began = time.perf_counter()
        for network in networks if joint is None else [joint]:
            network(image)
        took[name].append(time.perf_counter() - began)
    return {name: 1e3 * float(np.median(times)) for name, times in took.items()}


def summary(table: pd.DataFrame) -> Iterator[dict]:
    """Of the images of one set and camera: a row for each light."""
    for light, images in table.groupby("light", sort=False):
        overlaps = images[[f"{name}_iou" for name in FILTERS]].mean()
        counts = shares(images.astype({"right": bool, "wrong": bool}), ("right", "wrong"))
        yield {"light": light, "images": len(images), **overlaps, **counts}


def main() -> None:
    torch.set_num_threads(1)
    joint = str(Path(sys.argv[1], "{}-{}-slim.safetensors"))
    patterns, rows = {"slim": str(weight_path("{}", "{}", "slim")), "joint": joint}, []
    for modality in CHANNELS:
        times_ms = milliseconds(patterns, modality)
        for name, pattern in patterns.items():
            nets = filters_of(pattern, modality)
            nets = [both] if (both := join(nets, modality)) else nets
            costs = pd.DataFrame([cost(net, CHANNELS[modality]) for net in nets]).sum()
            own = {"set": name, "modality": modality, **costs, "ms": times_ms[name]}
            tasks = [
                joblib.delayed(judged)(pattern, modality, place, judged_images.LIGHTS) for place in PLACES
            ]
            found = [row for part in joblib.Parallel(os.cpu_count())(tasks) for row in part]
            rows += [own | row for row in summary(pd.DataFrame(found))]
            print(pd.DataFrame(rows[-3:]).round(2).to_string(), flush=True)
    save_table(DATA / "results" / "joint.csv", pd.DataFrame(rows), places=PLACES)


if __name__ == "__main__":
    main()
