"""The batches that a filter learns from, and the loop in which every filter learns."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Protocol

import numpy as np
import torch
from torch.nn import functional as F

from lmmap.pipeline.network import FilterNet, encode, faster_precision
from lmmap.settings import PAPER

from . import augment
from .checkpoint import resume, save_checkpoint
from .recipe import Recipe

Loss = Callable[[torch.Tensor, torch.Tensor], torch.Tensor]
MASK_LOSS: Loss = F.binary_cross_entropy_with_logits


class AnySamples(Protocol):
    """Images and the masks of one filter or of both, as `dataset.Samples`."""

    def __len__(self) -> int: ...

    def mask(self, index: int) -> np.ndarray:
        """Mask (H, W) bool, or u8 with a bit for each filter."""

    def image(self, index: int, events: int) -> np.ndarray:
        """Frame (H, W, 3), or histogram (H, W) of this many events."""


def make_batch(samples: AnySamples, recipe: Recipe, step: int, encode=encode):
    """Crops of step ``step``.  They depend on the recipe's seed and the step alone, so that runs resume.

    Returns
    -------
    input (B, C, S, S) f32, target (B, M, S, S) f32 of M masks
    """
    rng = np.random.default_rng([recipe.seed, step])
    pairs = [_crop(samples, recipe, rng) for _ in range(recipe.batch)]
    x, y = (np.stack([pair[i] for pair in pairs]) for i in (0, 1))
    return encode(x, recipe.modality), torch.from_numpy(augment.each_mask(y)).float()


def _crop(samples, recipe, rng):
    """One varied crop and its mask."""
    index, size = rng.integers(len(samples)), recipe.crop_px
    mask, other = samples.mask(index), rng.integers(len(samples))
    events = events_of(recipe, rng)
    corner = rng.integers(0, np.array(mask.shape) - size + 1)
    # markers have few pixels: half of the crops that want positive ones want theirs
    wanted = mask if mask.dtype == bool else augment.each_mask(mask)[int(rng.random() < 0.5)]
    positive = np.flatnonzero(wanted) if rng.random() < recipe.positive_crops else ()
    if len(positive):
        pixel = np.array(np.unravel_index(positive[rng.integers(len(positive))], mask.shape))
        corner = np.clip(pixel - rng.integers(0, size, 2), 0, np.array(mask.shape) - size)
    window = tuple(slice(a, a + size) for a in corner)
    image = samples.image(index, events)[window].astype(np.float32)
    image, mask = augment.flip([image, mask[window]], rng)
    if not recipe.robust:
        return vary(image, mask, None, recipe, rng)
    cover = samples.image(other, events)[window].astype(np.float32)
    if samples.mask(other)[window].any():
        cover = np.zeros_like(image)  # something plain and dark instead
    return vary(image, mask, cover, recipe, rng)


def events_of(recipe: Recipe, rng) -> int:
    """How many events a training image has."""
    events = PAPER.events_per_window
    return int(events * np.exp(rng.uniform(*np.log(augment.HISTOGRAM_EVENTS)))) if recipe.robust else events


def vary(image, mask, cover, recipe: Recipe, rng) -> tuple[np.ndarray, np.ndarray]:
    """An image and its mask, varied as a recipe has it; ``cover`` is as in `augment.clutter`."""
    if not recipe.robust:
        return (augment.expose(image, rng) if recipe.modality == "rgb" else image), mask
    change = augment.robust_frame if recipe.modality == "rgb" else augment.robust_histogram
    return change(image, mask, cover, rng)


def half_precision(device: torch.device):
    """Autocast to bfloat16 on a GPU, and on processors that are faster with it; others emulate it, four
    to eight times slower than float32."""
    fast = device.type != "cpu" or faster_precision() == "bfloat16"
    return torch.autocast(device.type, torch.bfloat16, enabled=fast)


def taught(teacher: FilterNet | None, x, y):
    """What is to be learned: the true masks, or their mean with the teacher's (Hinton et al. 2015)."""
    return y if teacher is None else (y + torch.sigmoid(teacher(x).float())) / 2


def learning_rate(recipe: Recipe, step: int) -> float:
    """A warm-up, then half a cosine down to zero."""
    warm_up = min((step + 1) / recipe.warm_up, 1)
    return recipe.rate * warm_up * 0.5 * (1 + np.cos(np.pi * step / recipe.steps))


def take_step(net, adam, pair, recipe, step, teacher=None, loss_of: Loss = MASK_LOSS) -> float:
    """One step of Adam; returns its loss."""
    net.train()
    for group in adam.param_groups:
        group["lr"] = learning_rate(recipe, step)
    device = next(net.parameters()).device
    x = pair[0].to(device, memory_format=torch.channels_last)
    with half_precision(device):
        logits, target = net(x), taught(teacher, x, pair[1].to(device))
    loss = loss_of(logits.float(), target)
    adam.zero_grad()
    loss.backward()
    adam.step()
    return loss.item()


def learn(net: torch.nn.Module, recipe: Recipe, batch: Callable[[int], tuple], checkpoint: Path, every: int,
          teacher: FilterNet | None = None, check: Callable[[int], dict] | None = None,
          loss_of: Loss = MASK_LOSS) -> Iterator[tuple[int, list]]:  # fmt: skip
    """Take all steps of a recipe, from the checkpoint on if there is one.

    Parameters
    ----------
    batch
        Makes the input and target of a step.
    every
        Steps between two checkpoints; there is one at the end, too.
    check
        What to note of the network at each checkpoint, from the number of steps done.
    loss_of
        The loss of answers, by their targets.

    Yields
    ------
    The number of steps done, first that of the checkpoint, and what was noted so far.
    """
    adam = torch.optim.Adam(net.parameters(), recipe.rate)
    start, curve = resume(checkpoint, net, adam, recipe)
    yield start, curve
    losses = []
    for done in range(start + 1, recipe.steps + 1):
        losses.append(take_step(net, adam, batch(done - 1), recipe, done - 1, teacher, loss_of))
        if done == recipe.steps or done % every == 0:
            if check:
                loss = round(float(np.mean(losses)), 6)
                curve.append({"step": done, "training_loss": loss, **check(done)})
            checkpoint.parent.mkdir(parents=True, exist_ok=True)
            save_checkpoint(checkpoint, net, adam, recipe, done, curve)
            losses = []
        yield done, curve
