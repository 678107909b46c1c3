"""Converts the filters of events to spiking networks, and trains them further by surrogate gradients.

    python tuning/train_spikes.py --balance
    python tuning/train_spikes.py --filter ring --kind plain --steps 2000 --device cuda -o DIR

The first command finds the thresholds, data/results/spikes/ceilings.json, from windows of training sequences;
the networks of the second begin with them and with the weights of the paper's low domain gap.  Its crops are
those of any training (`lmmap_lab.training.train`), cut into slices in the order of time; backward, a triangle
stands for the derivative of a spike.  Windows of the training sequences are made where they are absent
(--samples), and checkpoints in DIR let an interrupted run go on.  `benchmarks/spikes.py` judges the networks
on other sequences.
"""

from __future__ import annotations

import argparse
import os
from functools import partial
from pathlib import Path

import numpy as np
import torch

from lmmap.pipeline.weights import FILTERS
from lmmap_lab.provenance import DERIVED_DATA, save_json
from lmmap_lab.studies.spikes import GAP, KINDS, RESULTS, TRAINED_SLICES, ordinary_net, spiking_net
from lmmap_lab.training import dataset, train
from lmmap_lab.training.recipe import Recipe
from lmmap_lab.training.slices import SliceSamples, encode_slices, make_windows
from lmmap_lab.training.spiking import ceilings_of

# a few of the set's sequences: the training is short
SEQUENCES = [*dataset.SETS[GAP][: dataset.AUGMENTED : 15], *dataset.SETS[GAP][dataset.AUGMENTED :: 10]]
BALANCED = dataset.split(SEQUENCES)[0]
WINDOWS = 4  # of a sequence
RATE = 3e-4


def say(line: str) -> None:
    print(f"spikes: {line}", flush=True)


def balance(folder: Path, jobs: int) -> None:
    """Find the thresholds of both filters, and write them."""
    make_windows(BALANCED, folder, WINDOWS, jobs, say)
    ceilings = {}
    for name in FILTERS:
        samples = SliceSamples(BALANCED, name, "event", folder, 1)
        images = (encode_slices(samples.image(i)[None]) for i in range(0, len(samples), WINDOWS))
        ceilings[name] = [
            np.round(layer.astype(float), 5).tolist() for layer in ceilings_of(ordinary_net(name), images)
        ]
        say(f"{name}: balanced")
    save_json(RESULTS / "ceilings.json", ceilings, sequences=BALANCED)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--balance", action="store_true")
    parser.add_argument("--filter", choices=FILTERS, default="ring")
    parser.add_argument("--kind", choices=KINDS, default="plain")
    parser.add_argument("--steps", type=int, default=2000)
    parser.add_argument("--batch", type=int, default=16)
    parser.add_argument("--rate", type=float, default=RATE)
    parser.add_argument("--every", type=int, help="steps between two checks and checkpoints")
    parser.add_argument("--device", default="")
    parser.add_argument("--samples", type=Path, default=DERIVED_DATA / "spikes" / "training")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("-o", "--output", type=Path, default=DERIVED_DATA / "spikes" / "trained")
    asked = parser.parse_args()
    if asked.balance:
        balance(asked.samples, asked.jobs)
        return
    make_windows(SEQUENCES, asked.samples, WINDOWS, asked.jobs, say)

    def spiking(channels: int, prior: float) -> torch.nn.Module:
        return spiking_net(asked.filter, asked.kind, TRAINED_SLICES).requires_grad_(True)

    spiking.__name__ = f"{asked.kind}-{TRAINED_SLICES}"
    recipe = Recipe(asked.filter, "event", GAP, steps=asked.steps, batch=asked.batch, rate=asked.rate,
                    warm_up=max(asked.steps // 10, 1))  # fmt: skip
    path = asked.output / f"{asked.filter}-{asked.kind}.safetensors"
    train.train(recipe, asked.samples, say, path, SEQUENCES, asked.every, spiking,
                samples_of=partial(SliceSamples, slices=TRAINED_SLICES), encode=encode_slices,
                device=asked.device)  # fmt: skip
    say(f"{path}: written")


if __name__ == "__main__":
    main()
