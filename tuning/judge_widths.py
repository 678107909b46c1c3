"""Judges filters of several widths, with and without distillation: masks, poses, time (chooses nothing).

    python tuning/judge_widths.py FOLDER

FOLDER holds what ``train_widths.py`` writes.  The images are `judged_images` of the tuning sequences; poses
are counted in high light, with the settings of the *robust* filters.  Times are of one image of a DAVIS 346
on one core, filters alternating, and the multiply-accumulates are counted at its size.  The table is
data/results/widths.csv.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Sequence
from itertools import product
from pathlib import Path

import joblib
import judged_images
import numpy as np
import pandas as pd
import torch
from choose_thresholds import right
from train_widths import WEIGHTS, recipes

from lmmap.estimation.estimates import estimate_image
from lmmap.estimation.images import TimedImage
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.network import CHANNELS, FilterNet
from lmmap.pipeline.weights import FILTERS, load_filter, load_network, weight_path
from lmmap.settings import OURS
from lmmap.types import Pose
from lmmap_lab.bench import labels
from lmmap_lab.bench.renderer import ray_grid
from lmmap_lab.provenance import DATA, save_table
from lmmap_lab.studies.reliability import share_interval
from lmmap_lab.training.mask_quality import iou

PLACES = [place for place in judged_images.SETS if place.endswith("tuning")]
ROUNDS = 15  # of the timing


def sets(folder: Path) -> dict[str, str]:
    """Names of the files by names of the sets, ``{filter}`` and ``{modality}`` left open."""
    names = {label.split("-", 2)[2] for label in recipes(1)}
    found = {name: str(folder / f"{{}}-{{}}-{name}" / WEIGHTS) for name in sorted(names)}
    return {"robust": str(weight_path("{}", "{}", "robust")), **found}


def judged(pattern: str, modality: str, place: str, lights=("high",)) -> list[dict]:
    """A row for each image of a set of sequences: overlaps of both masks, and in these lights its pose."""
    torch.set_num_threads(1)
    networks = [load_network(pattern.format(name, modality), modality, "float32") for name in FILTERS]
    estimator = Estimator(judged_images.CAMERA, judged_images.PORT, modality, tuple(networks))
    rays, rows = ray_grid(judged_images.CAMERA, 4), []
    kinds = [kind for kind in judged_images.KINDS if kind.startswith(modality)]
    for name, light in judged_images.SETS[place].items():
        with np.load(judged_images.path_of(name)) as data:
            parts = [(data[k], data[f"{k} rotation"], data[f"{k} position_m"]) for k in kinds]
        for i in range(len(parts[0][0])):
            looks = [(images[i], Pose(R[i], p[i])) for images, R, p in parts]
            truth = labels.label_masks(looks[0][1], judged_images.PORT, judged_images.CAMERA, rays)
            masks = [network(looks[0][0]) > OURS.mask_threshold for network in networks]
            overlaps = {f"{f}_iou": iou(*pair) for f, *pair in zip(FILTERS, masks, truth, strict=True)}
            row = {"place": place, "sequence": name, "light": light, "modality": modality, **overlaps}
            if light in lights:
                wider = (1, looks[1][0]) if len(looks) > 1 else None
                _, e = estimate_image(estimator, TimedImage(0, looks[0][0], wider))
                posed = e.T_cam_port is not None
                good = posed and right(e.T_cam_port, looks[e.t_us][1], judged_images.PORT)
                row |= {"right": good, "wrong": posed and not good}
            rows.append(row)
    return rows


def cost(net: FilterNet, channels: int) -> dict:
    """Numbers of a filter, and its multiply-accumulates on one image."""
    macs = []

    def count(layer, inputs, output):
        places = (
            inputs[0] if isinstance(layer, torch.nn.ConvTranspose2d) else output
        )  # where its kernel is put
        macs.append(layer.weight.numel() * places[0, 0].numel())

    for layer in net.modules():
        if hasattr(layer, "weight"):
            layer.register_forward_hook(count)
    height, width = judged_images.CAMERA.size_px[::-1]
    with torch.inference_mode():
        net(torch.zeros(1, channels, height, width))
    last = net.up[2].weight.numel() * -(-height // 2) * -(-width // 2)  # `up_to_masks` is no layer
    return {"parameters": sum(p.numel() for p in net.parameters()), "gmacs": 1e-9 * (sum(macs) + last)}


def milliseconds(patterns: dict[str, str], modality: str) -> dict[str, float]:
    """Median time of the ring's filter on one image, all of them in turn."""
    torch.set_num_threads(1)
    size_px, rng = judged_images.CAMERA.size_px[::-1], np.random.default_rng(0)
    image = rng.integers(0, 9, (*size_px, 3) if modality == "rgb" else size_px).astype(np.uint8)
    networks = {k: load_network(p.format("ring", modality), modality) for k, p in patterns.items()}
    took = {name: [] for name in networks}
    for _ in range(ROUNDS):
        for name, network in networks.items():
            began = time.perf_counter()
            network(image)
            took[name].append(time.perf_counter() - began)
    return {name: 1e3 * float(np.median(times)) for name, times in took.items()}


def shares(images: pd.DataFrame, outcomes: Sequence[str]) -> dict:
    """Percentages of the images with each outcome, with their 95 % intervals."""
    row = {}
    for what in outcomes:
        values = images[what].mean(), *share_interval(images[what].sum(), len(images))
        names = (f"{what}_{end}" for end in ("percent", "low", "high"))
        row |= dict(zip(names, 100 * np.array(values), strict=True))
    return row


def summary(table: pd.DataFrame) -> dict:
    """Of the images of one set of filters and one camera."""
    high = table[table.light == "high"]
    row = {f"{name}_iou_{light}": t[f"{name}_iou"].mean()
           for name in FILTERS for light, t in table.groupby("light", sort=False)}  # fmt: skip
    row |= shares(high.astype({"right": bool, "wrong": bool}), ("right", "wrong"))
    return row | {"images": len(table), "images_high": len(high)}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--places", nargs="+", choices=PLACES, default=PLACES)
    a = parser.parse_args()
    patterns, rows = sets(a.folder), []
    times_ms = {m: milliseconds(patterns, m) for m in CHANNELS}
    for (name, pattern), modality in product(patterns.items(), CHANNELS):
        tasks = [joblib.delayed(judged)(pattern, modality, place) for place in a.places]
        table = pd.DataFrame([row for part in joblib.Parallel(os.cpu_count())(tasks) for row in part])
        net = load_filter(pattern.format("ring", modality), modality)
        rows.append({"set": name, "modality": modality, **cost(net, CHANNELS[modality]),
                     "ms": times_ms[modality][name], **summary(table)})  # fmt: skip
        print(pd.DataFrame(rows[-1:]).round(3).to_dict("records")[0], flush=True)
    save_table(DATA / "results" / "widths.csv", pd.DataFrame(rows), places=a.places)


if __name__ == "__main__":
    main()
