"""How a network goes on learning from a recording's own images: a few hundred steps of small crops."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import deepcopy
from functools import partial
from pathlib import Path
from threading import Event

import torch
from tqdm import tqdm

from lmmap.pipeline.crops import at_once
from lmmap.pipeline.network import FilterNet
from lmmap.pipeline.weights import load_filter

from ..training.batches import learn, make_batch
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


def train_both(nets: Sequence[FilterNet], samples: Sequence[Labelled], recipes: Sequence[Recipe],
               folder: Path) -> list[FilterNet]:  # fmt: skip
    """Both networks of a camera after all steps of their recipes, trained at once, each on half of torch's
    threads; their checkpoints in the folder make an interrupted run go on."""
    stop = Event()
    with tqdm(total=sum(r.steps for r in recipes), desc=f"learning, {recipes[0].modality}", unit=" steps",
              disable=None) as bar:  # fmt: skip

        def told(steps: int) -> None:
            bar.update(steps)
            if stop.is_set():
                raise InterruptedError

        trainings = [
            partial(train_on, *each, folder, told) for each in zip(nets, samples, recipes, strict=True)
        ]
        try:
            return at_once(*trainings)
        finally:
            stop.set()  # an interrupted call does not leave a thread that goes on


def train_on(net: FilterNet, samples: Labelled, recipe: Recipe, folder: Path,
             told: Callable[[int], None] = lambda steps: None) -> FilterNet:  # fmt: skip
    """The network after all steps of a recipe; ``told`` is called with the number of those just done."""
    before, batch = 0, partial(make_batch, samples, recipe)
    checkpoint = folder / f"{recipe.name}.ckpt.safetensors"
    for done, _ in learn(net, recipe, batch, checkpoint, CHECKPOINT_STEPS):
        told(done - before)
        before = done
    return net


def mean(old: FilterNet, new: FilterNet, share: float = LEARNED) -> FilterNet:
    """The network whose weights are a mean of those from before and, with this share, of those after its
    training: it forgets less of other places (Wortsman et al. 2022, arXiv 2109.01903)."""
    net, before, after = deepcopy(new), old.state_dict(), new.state_dict()
    net.load_state_dict({name: torch.lerp(before[name], after[name], share) for name in after})
    return net
