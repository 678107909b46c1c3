"""Training a filter, or both as one network: data, network, validation, weights; the loop is `batches.learn`.

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

from lmmap.pipeline.joint_network import apart
from lmmap.pipeline.network import CHANNELS, encode
from lmmap.pipeline.weights import FILTERS, load_card, save_weights, weight_path

from . import dataset
from .augment import each_mask
from .batches import half_precision, learn, make_batch
from .learning import card_of, seeded, shipped, teacher_of, untrained
from .recipe import JOINT, Recipe

CHECKPOINT_STEPS, CHECKED_IMAGES = 250, 32  # steps between checks, and held-out images of each check
VALIDATION_IMAGES = 128  # of the last check, spread evenly


@torch.inference_mode()
def validate(net: torch.nn.Module, samples: dataset.Samples, most: int = VALIDATION_IMAGES,
             encode=encode) -> dict:  # fmt: skip
    """Mean loss over the pixels of up to ``most`` images, and the intersection over union of all masks
    together; of a network of several masks, a list of each."""
    net.eval()
    device, loss, counts = next(net.parameters()).device, 0.0, []
    indices = np.unique(np.linspace(0, len(samples) - 1, min(most, len(samples))).astype(int))
    for i in indices:
        x = encode(samples.image(i)[None], samples.modality).to(device, memory_format=torch.channels_last)
        with half_precision(device):
            logits = net(x)[0].float()
        target = torch.from_numpy(each_mask(samples.mask(i))).to(device)
        loss += F.binary_cross_entropy_with_logits(logits, target.float()).item() / len(indices)
        found = logits > 0
        counts.append(torch.stack([target & found, target | found]).sum((-2, -1)).cpu())
    inter, union = torch.stack(counts).sum(0)
    iou = [round(i / max(u, 1), 4) for i, u in zip(inter.tolist(), union.tolist(), strict=True)]
    return {"loss": round(loss, 6), "iou": iou if len(iou) > 1 else iou[0], "images": len(indices)}


def train(recipe: Recipe, folder: Path, report=print, weights: Path | None = None, names=None,
          every: int | None = None,
          network: Callable[[int, float], torch.nn.Module] | None = None,
          samples_of: Callable[..., dataset.Samples] = dataset.Samples,
          encode=encode, device: str = "") -> Path:  # fmt: skip
    """Train one filter, resume it from its checkpoint, and save its weights; returns their path.

    Of both, trained as one network, the weights of each are saved; the path is then the ring's.

    Parameters
    ----------
    folder
        The training set, made where it is absent, and the checkpoints of shipped weights.
    weights
        Where to write, and where to keep checkpoints; default: where the package looks for weights.
    names
        Sequences; default: the set's.
    every
        Steps between two checks and checkpoints; default: `CHECKPOINT_STEPS`.
    network
        Makes the network from its input channels and the share of positive pixels; default: a `FilterNet`.
        It takes images (N, C, H, W) and returns logits (N, 1, H, W).
    samples_of
        Makes the samples of sequences, as `dataset.Samples`.
    encode
        Makes the network's input of their images, as `network.encode`.
    device
        Default: a graphics card where there is one.
    """
    names, every = names or dataset.SETS[recipe.networks], every or CHECKPOINT_STEPS
    dataset.make_samples(names, folder, report=report)
    samples, held_out = (samples_of(part, recipe.filter, recipe.modality, folder)
                         for part in dataset.split(names))  # fmt: skip
    prior, device = samples.positive_share(), device or ("cuda" if torch.cuda.is_available() else "cpu")
    if network:
        net = seeded(recipe, network, CHANNELS[recipe.modality], prior)
        run = f"{recipe.name}-{network.__name__}"
    else:
        net, run = untrained(recipe, prior), recipe.name
    if recipe.start_from:  # another start is another run
        run += f"-from-{load_card(shipped(recipe, recipe.start_from))['sha256'][:8]}"
    net, teacher = net.to(device, memory_format=torch.channels_last), teacher_of(recipe, device)
    checkpoint = (weights.parent if weights else folder) / f"{run}.ckpt.safetensors"
    path = weights or weight_path(recipe.filter, recipe.modality, recipe.networks, recipe.seed)

    def batch(step: int):
        return make_batch(samples, recipe, step, encode)

    def check(step: int) -> dict:
        return validate(net, held_out, VALIDATION_IMAGES if step == recipe.steps else CHECKED_IMAGES, encode)

    start_s, first = time.monotonic(), None
    with torch.backends.cudnn.flags(enabled=True, benchmark=False, deterministic=True):
        for step, curve in learn(net, recipe, batch, checkpoint, every, teacher, check):
            first = step if first is None else first
            if step > first and curve and curve[-1]["step"] == step:
                left_min = (time.monotonic() - start_s) / (step - first) * (recipe.steps - step) / 60
                report("{}: step {step} of {}, loss {loss:.4f}, IoU {iou}, {:.0f} min left".format(
                    recipe.name, recipe.steps, left_min, **curve[-1]))  # fmt: skip
    path.parent.mkdir(parents=True, exist_ok=True)
    card = card_of(recipe, samples, held_out, prior, device, curve)
    if network:
        card["network"] = network.__name__
    if recipe.filter != JOINT:
        save_weights(net, path, card)
        return path
    paths = [path.with_name(path.name.replace(JOINT, name, 1)) for name in FILTERS]
    for k, (own, filter_path) in enumerate(zip(apart(net, recipe.modality), paths, strict=True)):
        of_mask = {"prior": card["prior"][k], "curve": [point | {"iou": point["iou"][k]} for point in curve]}
        save_weights(own, filter_path, card | of_mask)
    return paths[0]
