"""How a network goes on learning from a recording's own images: a few hundred steps of small crops."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path

import torch
from tqdm import trange

from lmmap.pipeline.network import FilterNet
from lmmap.pipeline.weights import load_filter

from ..training.batches import make_batch, take_step
from ..training.checkpoint import resume, save_checkpoint
from ..training.recipe import Recipe
from .self_labels import Labelled

STEPS = 400
RATE = 2e-3
LEARNED = 0.75  # share of what was learned that a network takes
CHECKPOINT_STEPS = 50


def recipe_for(name: str, modality: str, steps: int, seed: int, recording: str) -> Recipe:
    """How a filter is trained on."""
    return Recipe(name, modality, "low", seed, steps, batch=8, rate=RATE, warm_up=10, data=recording)


def network_of(path: Path, modality: str) -> FilterNet:
    """A network of a weight file, as training takes it."""
    return load_filter(path, modality).to(memory_format=torch.channels_last)


def train_on(net: FilterNet, samples: Labelled, recipe: Recipe, folder: Path) -> FilterNet:
    """The network after all steps of a recipe; its checkpoints in the folder make an interrupted run go
    on."""
    adam = torch.optim.Adam(net.parameters(), recipe.rate)
    checkpoint = folder / f"{recipe.name}.ckpt.safetensors"
    start, _ = resume(checkpoint, net, adam, recipe)
    shown = trange(
        start, recipe.steps, initial=start, total=recipe.steps, desc=recipe.name, unit=" steps", disable=None
    )
    for step in shown:
        take_step(net, adam, make_batch(samples, recipe, step), recipe, step)
        if (step + 1) % CHECKPOINT_STEPS == 0 or step + 1 == recipe.steps:
            save_checkpoint(checkpoint, net, adam, recipe, step + 1, [])
    return net


def mean(old: FilterNet, new: FilterNet, share: float = LEARNED) -> FilterNet:
    """The network whose weights are a mean of those from before and, with this share, of those after its
    training: it forgets less of other places (Wortsman et al. 2022, arXiv 2109.01903)."""
    net, before, after = deepcopy(new), old.state_dict(), new.state_dict()
    net.load_state_dict({name: torch.lerp(before[name], after[name], share) for name in after})
    return net
