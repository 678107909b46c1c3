"""Training a filter: batches, steps, validation, checkpoints.

The paper trains with Adam and binary cross-entropy, and cuts its data 80/20.  Our cut is by sequence, not by
frame, so that no validation frame has a neighbour in training.  Ours are also: crops, most of them on
positive pixels; flips and quarter turns; warm-up and a cosine; and the output bias at the class prior.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from torch.nn import functional as F

from lmmap.files import tune_allocator
from lmmap.pipeline.network import CHANNELS, encode
from lmmap.pipeline.weights import load_card, save_weights, weight_path
from lmmap.settings import PAPER

from . import augment, dataset
from .checkpoint import resume, save_checkpoint
from .learning import card_of, half_precision, learning_rate, shipped, taught, teacher_of, untrained
from .recipe import Recipe

CHECKPOINT_STEPS, CHECKED_IMAGES = 250, 32  # steps between checks, and held-out images of each check
VALIDATION_IMAGES = 128  # of the last check, spread evenly


def make_batch(samples: dataset.Samples, recipe: Recipe, step: int):
    """Crops of step ``step``.  They depend on the recipe's seed and the step alone, so that runs resume.

    Returns
    -------
    input (B, C, S, S) f32, target (B, 1, S, S) f32
    """
    rng = np.random.default_rng([recipe.seed, step])
    pairs = [_crop(samples, recipe, rng) for _ in range(recipe.batch)]
    x, y = (np.stack([pair[i] for pair in pairs]) for i in (0, 1))
    return encode(x, recipe.modality), torch.from_numpy(y).float().unsqueeze(1)


def _crop(samples, recipe, rng):
    """One varied crop and its mask."""
    index, size = rng.integers(len(samples)), recipe.crop_px
    mask, other = samples.mask(index), rng.integers(len(samples))
    events = PAPER.events_per_window
    if recipe.robust:
        events = int(events * np.exp(rng.uniform(*np.log(augment.HISTOGRAM_EVENTS))))
    corner = rng.integers(0, np.array(mask.shape) - size + 1)
    positive = np.flatnonzero(mask) if rng.random() < recipe.positive_crops else ()
    if len(positive):
        pixel = np.array(np.unravel_index(positive[rng.integers(len(positive))], mask.shape))
        corner = np.clip(pixel - rng.integers(0, size, 2), 0, np.array(mask.shape) - size)
    window = tuple(slice(a, a + size) for a in corner)
    image = samples.image(index, events)[window].astype(np.float32)
    image, mask = augment.flip([image, mask[window]], rng)
    if not recipe.robust:
        return (augment.expose(image, rng) if recipe.modality == "rgb" else image), mask
    cover = samples.image(other, events)[window].astype(np.float32)
    if samples.mask(other)[window].any():
        cover = np.zeros_like(image)  # something plain and dark instead
    vary = augment.robust_frame if recipe.modality == "rgb" else augment.robust_histogram
    return vary(image, mask, cover, rng)


@torch.inference_mode()
def validate(net: torch.nn.Module, samples: dataset.Samples, most: int = VALIDATION_IMAGES) -> dict:
    """Mean loss over the pixels of up to ``most`` images, and the intersection over union of all masks
    together."""
    net.eval()
    device, loss, inter, union = next(net.parameters()).device, 0.0, 0, 0
    indices = np.unique(np.linspace(0, len(samples) - 1, min(most, len(samples))).astype(int))
    for i in indices:
        x = encode(samples.image(i)[None], samples.modality).to(device, memory_format=torch.channels_last)
        with half_precision(device):
            logits = net(x)[0, 0].float()
        target = torch.from_numpy(samples.mask(i)).to(device)
        loss += F.binary_cross_entropy_with_logits(logits, target.float()).item() / len(indices)
        inter += (target & (logits > 0)).sum().item()
        union += (target | (logits > 0)).sum().item()
    return {"loss": round(loss, 6), "iou": round(inter / max(union, 1), 4), "images": len(indices)}


def train(recipe: Recipe, folder: Path, report=print, weights: Path | None = None, names=None,
          every: int | None = None,
          network: Callable[[int, float], torch.nn.Module] | None = None,
          validation_images: int = VALIDATION_IMAGES) -> Path:  # fmt: skip
    """Train one filter, resume it from its checkpoint, and save its weights; returns their path.

    Parameters
    ----------
    folder
        The training set, made where it is absent, and the checkpoints of shipped weights.
    weights
        Where to write, and where to keep checkpoints; default: where the package looks for weights.
    names
        Sequences; default: the domain gap's.
    every
        Steps between two checks and checkpoints; default: `CHECKPOINT_STEPS`.
    network
        Makes the network from its input channels and the share of positive pixels; default: a `FilterNet`.
        It takes images (N, C, H, W) and returns logits (N, 1, H, W).
    validation_images
        Held-out images of the last check.
    """
    names, every = names or dataset.SETS[recipe.domain_gap], every or CHECKPOINT_STEPS
    dataset.make_samples(names, folder, report=report)
    samples, held_out = (dataset.Samples(part, recipe.filter, recipe.modality, folder)
                         for part in dataset.split(names))  # fmt: skip
    prior, device = samples.positive_share(), "cuda" if torch.cuda.is_available() else "cpu"
    tune_allocator()
    net, run = untrained(recipe, prior), recipe.name
    if network:
        torch.manual_seed(recipe.seed)
        net, run = network(CHANNELS[recipe.modality], prior), f"{run}-{network.__name__}"
    if recipe.start_from:  # another start is another run
        run += f"-from-{load_card(shipped(recipe, recipe.start_from))['sha256'][:8]}"
    net, teacher = net.to(device, memory_format=torch.channels_last), teacher_of(recipe, device)
    adam = torch.optim.Adam(net.parameters(), recipe.rate)
    checkpoint = (weights.parent if weights else folder) / f"{run}.ckpt.safetensors"
    start, curve = resume(checkpoint, net, adam, recipe)
    path = weights or weight_path(recipe.filter, recipe.modality, recipe.domain_gap, recipe.seed)
    start_s, losses = time.monotonic(), []
    with torch.backends.cudnn.flags(enabled=True, benchmark=False, deterministic=True):
        for step in range(start, recipe.steps):
            losses.append(_step(net, adam, teacher, make_batch(samples, recipe, step), recipe, step))
            last = step + 1 == recipe.steps
            if last or (step + 1) % every == 0:
                fit = validate(net, held_out, validation_images if last else CHECKED_IMAGES)
                curve.append({"step": step + 1, "training_loss": round(float(np.mean(losses)), 6), **fit})
                checkpoint.parent.mkdir(parents=True, exist_ok=True)
                save_checkpoint(checkpoint, net, adam, recipe, step + 1, curve)
                pace_s = (time.monotonic() - start_s) / (step + 1 - start)
                left_min = pace_s * (recipe.steps - step - 1) / 60
                report("{}: step {step} of {}, loss {loss:.4f}, IoU {iou:.3f}, {:.0f} min left".format(
                    recipe.name, recipe.steps, left_min, **curve[-1]))  # fmt: skip
                losses = []
    path.parent.mkdir(parents=True, exist_ok=True)
    card = card_of(recipe, samples, held_out, prior, device, curve)
    if network:
        card["network"] = network.__name__
    save_weights(net, path, card)
    return path


def _step(net, adam, teacher, pair, recipe, step) -> float:
    """Take one step of Adam; returns its loss."""
    net.train()
    for group in adam.param_groups:
        group["lr"] = learning_rate(recipe, step)
    device = next(net.parameters()).device
    x = pair[0].to(device, memory_format=torch.channels_last)
    with half_precision(device):
        logits, target = net(x), taught(teacher, x, pair[1].to(device))
    loss = F.binary_cross_entropy_with_logits(logits.float(), target)
    adam.zero_grad()
    loss.backward()
    adam.step()
    return loss.item()
