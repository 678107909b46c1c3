"""Training the filters on the bench: data set, loop, checkpoints.

The paper's recipe: Adam, binary cross-entropy, an 80/20 cut.  Ours cuts by sequence, not by frame, so
that neighbouring frames do not leak.  Beyond the recipe: crops, half of them on positives, flips and
quarter turns, warm-up and cosine, the output bias at the class prior.
"""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from safetensors import safe_open
from safetensors.torch import save_file
from torch.nn import functional as F

from . import sequences
from .core import PAPER, Camera, Port
from .events import histogram, windows
from .filters import CHANNELS, FILTERS, FilterNet, encode, save_weights, weight_path

AUGMENTED, REALISTIC = 40, 25  # sequences of each kind
SEQUENCE_SECONDS, SAMPLES = 2.5, 10
CHECKPOINT_STEPS = 250
SETS = {
    "high": [f"augmented-{i}" for i in range(AUGMENTED)],
    "low": [f"augmented-{i}" for i in range(AUGMENTED)] + [f"realistic-{i}" for i in range(REALISTIC)],
}


@dataclass(frozen=True)
class Recipe:
    """What a training run depends on, and what its model card prints."""

    filter: str
    modality: str
    domain_gap: str = "low"
    seed: int = 0
    steps: int = 2000
    batch: int = 16
    crop_px: int = 96
    rate: float = 1e-3
    warm_up: int = 100


def samples(name: str, folder: Path) -> Path:
    """Simulate a sequence once and keep its images with their masks in ``folder/NAME.npz``."""
    path = folder / f"{name}.npz"
    if path.exists():
        return path
    recording, port, rays = sequences.simulate(name, SEQUENCE_SECONDS), Port.lm_map(), None
    camera = recording.camera
    rays = sequences.shading.ray_grid(camera, 4)

    def masks(times_us):
        poses = recording.truth.at(times_us)
        return np.stack([sequences.label_masks(pose, port, camera, rays) for pose in poses])

    slices = windows(recording.events, PAPER.events_per_window)
    some = [slices[i] for i in _spread(len(slices), SAMPLES)]
    events = [recording.events[s] for s in some]
    counts = [histogram(e["x"], e["y"], camera.size_px) for e in events]
    middle_us = np.array([(e["t_us"][0] + e["t_us"][-1]) // 2 for e in events])
    pick = _spread(len(recording.frames), SAMPLES)
    folder.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part.npz")
    np.savez(
        part,
        rgb=recording.frames[pick],
        rgb_masks=masks(recording.frames_t_us[pick]),
        event=np.minimum(np.array(counts), 255).astype(np.uint8).reshape(-1, *camera.size_px[::-1]),
        event_masks=masks(middle_us) if len(events) else np.zeros((0, 2, *camera.size_px[::-1]), bool),
    )
    os.replace(part, path)
    return path


def _spread(total: int, wanted: int) -> np.ndarray:
    return np.unique(np.linspace(0, total - 1, min(wanted, total)).astype(int))


def load(names: list[str], filter_name: str, modality: str, folder: Path):
    """Images and boolean masks (N, H, W) of all samples of some sequences."""
    images, masks = [], []
    for name in names:
        with np.load(samples(name, folder)) as data:
            images.append(data[modality])
            masks.append(data[f"{modality}_masks"][:, FILTERS.index(filter_name)])
    return np.concatenate(images), np.concatenate(masks)


def split(names: list[str]) -> tuple[list[str], list[str]]:
    """80/20 by sequence: every fifth validates."""
    return [n for i, n in enumerate(names) if i % 5 != 4], names[4::5]


def batch(images, masks, recipe: Recipe, step: int):
    """Crops of step ``step``: a function of the recipe's seed and the step alone, so runs resume."""
    rng = np.random.default_rng([recipe.seed, step])
    size, (height, width) = recipe.crop_px, masks.shape[1:]
    x, y = [], []
    for i in rng.integers(0, len(images), recipe.batch):
        row, column = rng.integers(0, height - size + 1), rng.integers(0, width - size + 1)
        active = np.argwhere(masks[i])
        if len(active) and rng.random() < 0.65:
            centre = active[rng.integers(len(active))] - rng.integers(0, size, 2)
            row, column = np.clip(centre, 0, [height - size, width - size])
        turns, flip = rng.integers(4), rng.random() < 0.5
        for source, out in ((images, x), (masks, y)):
            piece = np.rot90(source[i, row : row + size, column : column + size], turns)
            out.append(piece[:, ::-1] if flip else piece)
    x = np.stack(x)
    if recipe.modality == "rgb":  # another exposure and white balance
        gain = np.exp(
            rng.normal(0, 0.35, (recipe.batch, 1, 1, 1)) + rng.normal(0, 0.08, (recipe.batch, 1, 1, 3))
        )
        x = np.clip(x * gain, 0, 255).astype(np.float32)
    return encode(x, recipe.modality), torch.from_numpy(np.stack(y)).float().unsqueeze(1)


@torch.inference_mode()
def validate(net: FilterNet, images, masks, modality: str) -> dict:
    """Mean loss over pixels, and the intersection over union of all masks together."""
    loss = inter = union = 0.0
    for i in range(len(images)):
        logits = net(encode(images[i : i + 1], modality))[0, 0]
        target = torch.from_numpy(masks[i])
        loss += F.binary_cross_entropy_with_logits(logits, target.float()).item() / len(images)
        inter += (target & (logits > 0)).sum().item()
        union += (target | (logits > 0)).sum().item()
    return {"loss": round(loss, 6), "iou": round(inter / max(union, 1), 4)}


def train(recipe: Recipe, folder: Path, report=print) -> Path:
    """Train one filter, resuming from its checkpoint, and ship its weights; returns their path."""
    training, validation = split(SETS[recipe.domain_gap])
    images, masks = load(training, recipe.filter, recipe.modality, folder)
    held_out = load(validation, recipe.filter, recipe.modality, folder)
    torch.manual_seed(recipe.seed)
    net = FilterNet(CHANNELS[recipe.modality], prior=float(masks.mean()))
    net = net.to(memory_format=torch.channels_last)
    adam = torch.optim.Adam(net.parameters(), recipe.rate)
    name = f"{recipe.filter}-{recipe.modality}-{recipe.domain_gap}-{recipe.seed}"
    checkpoint = folder / f"{name}.ckpt.safetensors"
    start, curve = _resume(checkpoint, net, adam, recipe)
    for step in range(start, recipe.steps):
        for group in adam.param_groups:
            warm = min((step + 1) / recipe.warm_up, 1)
            group["lr"] = recipe.rate * warm * 0.5 * (1 + np.cos(np.pi * step / recipe.steps))
        x, y = batch(images, masks, recipe, step)
        with torch.autocast("cpu", torch.bfloat16):
            logits = net(x.contiguous(memory_format=torch.channels_last))
        loss = F.binary_cross_entropy_with_logits(logits.float(), y)
        adam.zero_grad()
        loss.backward()
        adam.step()
        if (step + 1) % CHECKPOINT_STEPS == 0 or step + 1 == recipe.steps:
            curve.append({"step": step + 1, "training_loss": round(loss.item(), 6),
                          **validate(net, *held_out, recipe.modality)})  # fmt: skip
            _checkpoint(checkpoint, net, adam, recipe, step + 1, curve)
            report(f"{recipe.filter} {recipe.modality} {curve[-1]}")
    path = weight_path(recipe.filter, recipe.modality, recipe.domain_gap)
    path.parent.mkdir(parents=True, exist_ok=True)
    command = (
        f"lmmap train --filter {recipe.filter} --modality {recipe.modality} "
        f"--domain-gap {recipe.domain_gap} --seed {recipe.seed} --steps {recipe.steps}"
    )
    card = {"command": command, "recipe": asdict(recipe),
            "training_sequences": training, "validation_sequences": validation,
            "training_images": len(images), "validation_images": len(held_out[0]),
            "camera": Camera.davis346().size_px, "curve": curve}  # fmt: skip
    save_weights(net, path, card)
    return path


def _checkpoint(path, net, adam, recipe, step, curve) -> None:
    tensors = {f"net.{k}": v.detach().contiguous() for k, v in net.state_dict().items()}
    for i, state in adam.state_dict()["state"].items():
        tensors |= {f"adam.{i}.{k}": v.contiguous() for k, v in state.items()}
    facts = {"recipe": json.dumps(asdict(recipe)), "step": str(step), "curve": json.dumps(curve)}
    part = path.with_suffix(".part")
    save_file(tensors, part, facts)
    os.replace(part, path)


def _resume(path, net, adam, recipe) -> tuple[int, list]:
    if not path.exists():
        return 0, []
    with safe_open(path, "pt") as file:
        facts = file.metadata()
        if json.loads(facts["recipe"]) != asdict(recipe):
            return 0, []
        tensors = {k: file.get_tensor(k) for k in file.keys()}  # noqa: SIM118
    net.load_state_dict({k[4:]: v for k, v in tensors.items() if k.startswith("net.")})
    state = adam.state_dict()
    for k, v in tensors.items():
        if k.startswith("adam."):
            _, i, name = k.split(".")
            state["state"].setdefault(int(i), {})[name] = v
    adam.load_state_dict(state)
    return int(facts["step"]), json.loads(facts["curve"])
