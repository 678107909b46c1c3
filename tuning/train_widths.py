"""Trains the filters of several widths, with and without distillation, on the same crops.

    python tuning/train_widths.py -o FOLDER [--steps N] [--jobs N]

All learn from *robust*'s sequences, from chance, with equal steps.  A *taught* one learns from the masks of
the shipped *robust* filters as much as from the true ones.  Beside them, the *robust* filters are trained
further (``-further``), and for each camera one network that gives both masks (``joint``).  An interrupted run
goes on from its checkpoints.  The committed ones but the last were trained at once on a GPU, where a step of
all of them was one graph, by ``lmmap_lab/training/together.py`` of commit e5d3c83; each ends as it does
alone, but for rounding.
"""

from __future__ import annotations

import argparse
from itertools import product
from pathlib import Path

import joblib

from lmmap.pipeline.network import CHANNELS
from lmmap.pipeline.weights import FILTERS
from lmmap_lab.provenance import DERIVED_DATA
from lmmap_lab.training.recipe import JOINT, Recipe
from lmmap_lab.training.train import train

SIZES = {"1": {"width": 1.0}, "2": {"width": 1 / 2}, "4": {"width": 1 / 4}, "8": {"width": 1 / 8},
         "depthwise": {"depthwise": True}}  # fmt: skip
WEIGHTS = "filter.safetensors"  # of a training, in a folder of its own
JOINT_WIDTH = 0.6  # of the network with both masks: three quarters of the arithmetic of two of half width
AGAIN_SEEDS = ("2", "4")  # of which a second seed is trained, too: about where the knee is
FURTHER_RATE = 1e-3  # with which *robust* goes on: it has learned at 3e-3


def recipes(steps: int, filters=FILTERS, modalities=tuple(CHANNELS)) -> dict[str, Recipe]:
    """All trainings by the names of their folders."""
    found = {}
    for name, modality in product(filters, modalities):
        kind = f"{name}-{modality}"
        for size, change in SIZES.items():
            same = {"width": 1.0, "steps": steps} | change
            found[f"{kind}-{size}"] = Recipe.of_shipped(name, modality, "slim", **same, teacher="")
            if size != "1":
                found[f"{kind}-{size}-taught"] = Recipe.of_shipped(name, modality, "slim", **same)
            if size in AGAIN_SEEDS:
                found[f"{kind}-{size}-taught-seed1"] = Recipe.of_shipped(
                    name, modality, "slim", **same, seed=1
                )
        further = {"steps": steps, "start_from": "robust", "rate": FURTHER_RATE}
        found[f"{kind}-further"] = Recipe.of_shipped(name, modality, "robust", **further)
    return found


def saved(path: Path) -> Path:
    """Where the ring's filter of a training lies."""
    return path.with_name(path.name.replace(JOINT, "ring"))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for weights and checkpoints")
    parser.add_argument("--samples", type=Path, default=DERIVED_DATA / "training", help="the training set")
    parser.add_argument("--steps", type=int, default=40_000, help="of each filter (default: %(default)s)")
    parser.add_argument("--jobs", type=int, default=1, help="filters at once")
    parser.add_argument("--filter", choices=FILTERS, action="append", help="one of the two (default: both)")
    parser.add_argument("--modality", choices=CHANNELS, action="append", help="one camera (default: both)")
    a = parser.parse_args()
    wanted = recipes(a.steps, a.filter or FILTERS, a.modality or CHANNELS)
    paths = {a.output / name / WEIGHTS: recipe for name, recipe in wanted.items()}
    for m in a.modality or CHANNELS if not a.filter else ():
        recipe = Recipe.of_shipped(JOINT, m, "slim", steps=a.steps, width=JOINT_WIDTH)
        paths[a.output / f"{recipe.name}.safetensors"] = recipe
    absent = {path: recipe for path, recipe in paths.items() if not saved(path).exists()}
    tasks = (joblib.delayed(train)(recipe, a.samples, weights=path) for path, recipe in absent.items())
    joblib.Parallel(a.jobs)(tasks)


if __name__ == "__main__":
    main()
