"""What a training begins with and learns from: its network and teacher, and what its card says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch

from lmmap.pipeline.network import CHANNELS, FilterNet
from lmmap.pipeline.weights import load_card, load_filter, weight_path
from lmmap.types import InputError

from ..provenance import commit
from .recipe import Recipe


def shipped(recipe: Recipe, networks: str) -> Path:
    """The weights of a set for the same filter and camera."""
    return weight_path(recipe.filter, recipe.modality, networks)


def seeded(recipe: Recipe, network: Callable, *values):
    """A network of these values, its weights drawn by the recipe's seed; torch's own generator goes on as if
    nothing had been drawn."""
    with torch.random.fork_rng():
        torch.manual_seed(recipe.seed)
        return network(*values)


def untrained(recipe: Recipe, prior: float) -> FilterNet:
    """The network that a recipe begins with."""
    net = seeded(recipe, FilterNet, CHANNELS[recipe.modality], prior, recipe.widths, recipe.depthwise)
    if recipe.start_from:
        first = load_filter(shipped(recipe, recipe.start_from), recipe.modality)
        try:
            net.load_state_dict(first.state_dict())
        except RuntimeError:
            text = f"its networks are not of the widths of {recipe.networks}; start from another set"
            raise InputError(f"--start-from {recipe.start_from}: {text}") from None
    return net


def teacher_of(recipe: Recipe, device) -> FilterNet | None:
    """The network whose masks a recipe learns from, beside the true ones."""
    if not recipe.teacher:
        return None
    net = load_filter(shipped(recipe, recipe.teacher), recipe.modality)
    return net.to(device, memory_format=torch.channels_last).requires_grad_(False)


def card_of(recipe: Recipe, samples, held_out, prior: float, device: str, curve: list) -> dict:
    """What a model card says of a training."""
    of_others = {
        what: load_card(shipped(recipe, gap))["sha256"]
        for what, gap in (("start_sha256", recipe.start_from), ("teacher_sha256", recipe.teacher))
        if gap
    }
    return {"command": recipe.command, "recipe": asdict(recipe), "commit": commit(),
            "bench": samples.made_of(), "prior": np.round(prior, 6).tolist(),
            "training_sequences": samples.names, "validation_sequences": held_out.names,
            "training_images": len(samples), "validation_images": len(held_out),
            "device": device, "threads": torch.get_num_threads(), "torch": torch.__version__,
            **of_others, "curve": curve}  # fmt: skip
