"""Training the filters on the bench's data set: batches, loop, validation, checkpoints.

The paper's recipe: Adam, binary cross-entropy, an 80/20 cut.  Ours cuts by sequence, not by frame, so
that neighbouring frames do not leak.  Beyond the recipe: crops, most of them on positives, flips and
quarter turns, warm-up and cosine, the output bias at the class prior.
"""

from __future__ import annotations

import json
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch.nn import functional as F

from ..files import atomic
from ..pipeline.network import CHANNELS, FilterNet, encode, keep_freed_memory
from ..pipeline.weights import load_card, load_weights, save_weights, weight_path
from ..provenance import commit
from ..settings import PAPER
from ..types import InputError
from . import augment, dataset
from .recipe import Recipe

CHECKPOINT_STEPS, CHECKED = 250, 32  # how often, and on how many held-out images, progress is measured
MOST_VALIDATED = 128  # images of the last validation, spread evenly


def make_batch(samples: dataset.Samples, recipe: Recipe, step: int):
    """Crops of step ``step``: a function of the recipe's seed and the step alone, so runs resume.

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
    robust = recipe.domain_gap == "robust"
    index, size = rng.integers(len(samples)), recipe.crop_px
    mask, other = samples.mask(index), rng.integers(len(samples))
    events = PAPER.events_per_window
    if robust:
        events = int(events * np.exp(rng.uniform(*np.log(augment.HISTOGRAM_EVENTS))))
    corner = rng.integers(0, np.array(mask.shape) - size + 1)
    active = np.flatnonzero(mask) if rng.random() < recipe.positive_crops else ()
    if len(active):
        one = np.array(np.unravel_index(active[rng.integers(len(active))], mask.shape))
        corner = np.clip(one - rng.integers(0, size, 2), 0, np.array(mask.shape) - size)
    window = tuple(slice(a, a + size) for a in corner)
    image = samples.image(index, events)[window].astype(np.float32)
    image, mask = augment.flip([image, mask[window]], rng)
    if not robust:
        return (augment.expose(image, rng) if recipe.modality == "rgb" else image), mask
    cover = samples.image(other, events)[window].astype(np.float32)
    if samples.mask(other)[window].any():
        cover = np.zeros_like(image)  # something plain and dark instead
    vary = augment.robust_frame if recipe.modality == "rgb" else augment.robust_histogram
    return vary(image, mask, cover, rng)


@torch.inference_mode()
def validate(net: FilterNet, samples: dataset.Samples, most: int = MOST_VALIDATED) -> dict:
    """Mean loss over pixels, and the intersection over union of all masks together."""
    net.eval()
    device, loss, inter, union = next(net.parameters()).device, 0.0, 0, 0
    some = np.unique(np.linspace(0, len(samples) - 1, min(most, len(samples))).astype(int))
    for i in some:
        x = encode(samples.image(i)[None], samples.modality).to(device, memory_format=torch.channels_last)
        with torch.autocast(device.type, torch.bfloat16):
            logits = net(x)[0, 0].float()
        target = torch.from_numpy(samples.mask(i)).to(device)
        loss += F.binary_cross_entropy_with_logits(logits, target.float()).item() / len(some)
        inter += (target & (logits > 0)).sum().item()
        union += (target | (logits > 0)).sum().item()
    return {"loss": round(loss, 6), "iou": round(inter / max(union, 1), 4), "images": len(some)}


def train(recipe: Recipe, folder: Path, report=print, weights: Path | None = None, names=None,
          every: int | None = None, go_on: bool = False) -> Path:  # fmt: skip
    """Train one filter, resuming from its checkpoint, and keep its weights; returns their path.

    Parameters
    ----------
    folder
        The training set, made where it is absent, and the checkpoints.
    weights
        Where to write; default: where the package looks for them.
    names
        Sequences; default: the domain gap's.
    every
        Steps between two checks and checkpoints; default: `CHECKPOINT_STEPS`.
    go_on
        Without a checkpoint, begin with the weights that are there, if they ended where the recipe restarts.
        They are of half precision and Adam's moments are lost, so the card says it.
    """
    names, every = names or dataset.SETS[recipe.domain_gap], every or CHECKPOINT_STEPS
    dataset.make_samples(names, folder, report=report)
    samples, held_out = (
        dataset.Samples(some, recipe.filter, recipe.modality, folder) for some in dataset.split(names)
    )
    prior, device = samples.positive_share(), "cuda" if torch.cuda.is_available() else "cpu"
    torch.manual_seed(recipe.seed)
    keep_freed_memory()
    net = FilterNet(CHANNELS[recipe.modality], prior)
    run = f"{recipe.name}-{recipe.seed}"
    if recipe.start_from:
        first = weight_path(recipe.filter, recipe.modality, recipe.start_from)
        net.load_state_dict(load_weights(first, recipe.modality))
        run += f"-from-{load_card(first)['sha256'][:8]}"  # another start is another run
    net = net.to(device, memory_format=torch.channels_last)
    adam = torch.optim.Adam(net.parameters(), recipe.rate)
    checkpoint = folder / f"{run}.ckpt.safetensors"
    start, curve = _resume(checkpoint, net, adam, recipe)
    path = weights or weight_path(recipe.filter, recipe.modality, recipe.domain_gap)
    if go_on and not start:
        start, curve = _go_on(path, net, recipe)
    since, running = time.monotonic(), []
    with torch.backends.cudnn.flags(enabled=True, benchmark=False, deterministic=True):
        for step in range(start, recipe.steps):
            running.append(_step(net, adam, make_batch(samples, recipe, step), recipe, step))
            last = step + 1 == recipe.steps
            if last or (step + 1) % every == 0:
                curve.append({"step": step + 1, "training_loss": round(float(np.mean(running)), 6),
                              **validate(net, held_out, MOST_VALIDATED if last else CHECKED)})  # fmt: skip
                _checkpoint(checkpoint, net, adam, recipe, step + 1, curve)
                pace = (time.monotonic() - since) / (step + 1 - start)
                left_min = pace * (recipe.steps - step - 1) / 60
                report("{}: step {step} of {}, loss {loss:.4f}, IoU {iou:.3f}, {:.0f} min left".format(
                    recipe.name, recipe.steps, left_min, **curve[-1]))  # fmt: skip
                running = []
    path.parent.mkdir(parents=True, exist_ok=True)
    card = {"command": recipe.command, "recipe": asdict(recipe), "commit": commit(),
            "bench": samples.made_of(), "prior": round(prior, 6),
            "training_sequences": samples.names, "validation_sequences": held_out.names,
            "training_images": len(samples), "validation_images": len(held_out),
            "device": device, "threads": torch.get_num_threads(), "torch": torch.__version__,
            "curve": curve}  # fmt: skip
    save_weights(net, path, card)
    return path


def _step(net, adam, pair, recipe, step) -> float:
    """One step of Adam; its loss."""
    net.train()
    for group in adam.param_groups:
        warm = min((step + 1) / recipe.warm_up, 1)
        group["lr"] = recipe.rate * warm * 0.5 * (1 + np.cos(np.pi * recipe.phase(step)))
    device = next(net.parameters()).device
    x = pair[0].to(device, memory_format=torch.channels_last)
    with torch.autocast(device.type, torch.bfloat16):
        logits = net(x)
    loss = F.binary_cross_entropy_with_logits(logits.float(), pair[1].to(device))
    adam.zero_grad()
    loss.backward()
    adam.step()
    return loss.item()


def _go_on(path, net, recipe) -> tuple[int, list]:
    """As `_resume`, from weights of the same recipe until a restart; `InputError` if they are of another."""
    tensors, card = load_weights(path, recipe.modality), load_card(path)
    if card["recipe"] not in [json.loads(json.dumps(asdict(one))) for one in recipe.begun]:
        raise InputError(f"{path}: not of this training's first steps ({card['command']}); leave out --go-on")
    net.load_state_dict(tensors)
    card["curve"][-1]["went_on_from"] = card["sha256"]
    return card["recipe"]["steps"], card["curve"]


def _checkpoint(path, net, adam, recipe, step, curve) -> None:
    tensors = {f"net.{k}": v.detach().contiguous() for k, v in net.state_dict().items()}
    for i, state in adam.state_dict()["state"].items():
        tensors |= {f"adam.{i}.{k}": v.contiguous() for k, v in state.items()}
    facts = {"recipe": json.dumps(asdict(recipe)), "step": str(step), "curve": json.dumps(curve)}
    with atomic(path) as temporary:
        save_file(tensors, temporary, facts)


def _resume(path, net, adam, recipe) -> tuple[int, list]:
    """Put a checkpoint of the same recipe, or of the same until a restart, into net and optimiser; the next
    step, and the curve so far."""
    if not path.exists():
        return 0, []
    try:
        with safe_open(path, "pt") as file:
            facts = file.metadata()
            tensors = {k: file.get_tensor(k) for k in file.keys()}  # noqa: SIM118
    except (OSError, SafetensorError) as error:
        raise InputError(f"{path}: no readable checkpoint ({error}); delete it to start anew") from None
    if facts["recipe"] not in [json.dumps(asdict(one)) for one in (recipe, *recipe.begun)]:
        return 0, []
    net.load_state_dict({k[4:]: v for k, v in tensors.items() if k.startswith("net.")})
    state = adam.state_dict()
    for k, v in tensors.items():
        if k.startswith("adam."):
            _, i, name = k.split(".")
            state["state"].setdefault(int(i), {})[name] = v
    adam.load_state_dict(state)
    return int(facts["step"]), json.loads(facts["curve"])
