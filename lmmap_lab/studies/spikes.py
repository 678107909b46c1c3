"""What spiking networks are worth beside the ordinary ones: masks, poses, and how much there is to add up.

`judged` says what the masks of one window are worth, and `with_intervals` what those of many are, with
intervals by the bootstrap over sequences.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
import torch
from safetensors.torch import load_file

from lmmap.evaluation.error_table import METRICS, error_values, is_wrong
from lmmap.geometry.port import circle_points_m
from lmmap.geometry.projection import project
from lmmap.pipeline.crops import crop_bounds, mask_within
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.masks import markers_box_px
from lmmap.pipeline.network import SATURATION, FilterNet
from lmmap.pipeline.ring import binarise
from lmmap.pipeline.weights import load_filter, weight_path
from lmmap.settings import OURS, PAPER
from lmmap.types import Camera, Port, Pose

from ..bench import labels
from ..bench.renderer import ray_grid
from ..provenance import DATA, load_json
from ..training.mask_quality import iou
from ..training.spiking import SpikingNet, activations, padded, sliced
from . import bootstrap

RESULTS = DATA / "results" / "spikes"
CEILINGS = RESULTS / "ceilings.json"  # by tuning/train_spikes.py
GAP = "low"  # of the networks that are converted
SLICES = (4, 7, 28)  # T
EVENTS = tuple(range(5000, PAPER.events_per_window + 1, 5000))  # seen so far
TRAINED_SLICES, WATCHED = 7, 28  # with so many, signed networks are asked after each of `EVENTS`
BORDER_PX = 8.0  # around the ring, of what networks are judged on
KINDS = {"plain": False, "signed": True}
ONE_LOOK = replace(OURS, turned_look=False)  # masks are made beforehand, of the window as it is
ADDITION_PJ, MULTIPLY_PJ = 0.9, 3.7  # of 32-bit floats in 45 nm, Horowitz 2014
MEASURES = ("iou_ring", "iou_markers", "right_percent", "wrong_percent")
DRAWS = 2000


class Window(NamedTuple):
    """N events of a held-out sequence: pixel numbers and times (N,), and the true poses at times (K,)."""

    pixels: np.ndarray
    t_us: np.ndarray
    truth_at: Callable[[np.ndarray], Pose]


class Crop(NamedTuple):
    """Rows and columns of an image: those that networks get, and the box in which their masks are right."""

    given: tuple[slice, slice]
    box: tuple[slice, slice]


class Seen(NamedTuple):
    """Masks (H, W) of ring and markers from the first events of a window."""

    network: str
    slices: int
    events: int
    masks: tuple[np.ndarray, np.ndarray]


def crop_around(window: Window, camera: Camera, port: Port) -> Crop:
    """Where a track would look: around the ring, as it is at the first event and at the last one."""
    poses, ring = window.truth_at(window.t_us[[0, -1]]), circle_points_m(port.ring_outer_radius_m)
    seen = project(poses[:, None] @ ring, camera).reshape(-1, 2)
    low_px, high_px = seen.min(0) - BORDER_PX, seen.max(0) + BORDER_PX
    first, last = np.floor(low_px).clip(0).astype(int), np.ceil(high_px).astype(int)
    box = slice(first[1], last[1] + 1), slice(first[0], last[0] + 1)
    return Crop(crop_bounds(low_px, high_px, camera.size_px), box)


def ordinary_net(name: str) -> FilterNet:
    """The network of a filter that is converted."""
    return load_filter(weight_path(name, "event", GAP), "event").eval().requires_grad_(False)


def spiking_net(name: str, kind: str, slices: int, trained: Path | None = None) -> SpikingNet:
    """The spiking network of a filter, converted or from the file of a training; ``kind`` is of `KINDS`."""
    net = SpikingNet(ordinary_net(name), slices, KINDS[kind], load_json(CEILINGS)[name])
    if trained is not None:
        net.load_state_dict({key: values.float() for key, values in load_file(trained).items()})
    return net.eval().requires_grad_(False)


def input_of(
    net: torch.nn.Module, window: Window, camera: Camera, slices: int, crop: Crop | None = None
) -> torch.Tensor:
    """Slices (T, 1, h, w) of a window or of a crop of it, where the network is."""
    given = crop.given if crop else np.s_[:, :]
    x = sliced(window.pixels, camera.size_px[::-1], slices)[:, None, *given]
    return torch.from_numpy(np.ascontiguousarray(x)).to(next(net.parameters()).device)


def mask_of(logits: torch.Tensor, crop: Crop, camera: Camera) -> np.ndarray:
    """The mask (H, W) f32 of a crop's logits (1, 1, h, w): zero beyond the box."""
    whole = np.zeros(camera.size_px[::-1], np.float32)
    whole[crop.given] = torch.sigmoid(logits[0, 0].double()).float().cpu().numpy()
    mask = np.zeros_like(whole)
    mask[crop.box] = whole[crop.box]
    return mask


@torch.inference_mode()
def ordinary_masks(name: str, nets, window: Window, crop: Crop, camera: Camera) -> Iterator[Seen]:
    """Of the histogram of the first events, for each of `EVENTS`."""
    for events in EVENTS:
        x = input_of(nets[0], window._replace(pixels=window.pixels[:events]), camera, 1, crop)
        yield Seen(name, 1, events, tuple(mask_of(net(x), crop, camera) for net in nets))


@torch.inference_mode()
def spiking_masks(name: str, nets, window: Window, crop: Crop, camera: Camera) -> Iterator[Seen]:
    """After the whole window; signed networks of so many slices also after each of `EVENTS`."""
    slices, asked = nets[0].slices, nets[0].signed and nets[0].slices in (WATCHED, TRAINED_SLICES)
    x = input_of(nets[0], window, camera, slices, crop)
    for t, answers in enumerate(zip(*(net.answers(x) for net in nets), strict=True), 1):
        events = t * len(window.pixels) // slices
        if (asked and events in EVENTS) or t == slices:
            yield Seen(name, slices, events, tuple(mask_of(z, crop, camera) for z, _ in answers))


def truths(window: Window, camera: Camera, port: Port) -> dict[int, tuple[Pose, np.ndarray]]:
    """The true pose and masks (2, H, W) in the middle of the first events' span, by each of `EVENTS`."""
    middles_us = [(window.t_us[0] + window.t_us[events - 1]) // 2 for events in EVENTS]
    poses, rays = window.truth_at(np.array(middles_us)), ray_grid(camera, 4)
    return {
        n: (pose, labels.label_masks(pose, port, camera, rays)) for n, pose in zip(EVENTS, poses, strict=True)
    }


def judged(seen: Seen, truth: tuple[Pose, np.ndarray], window: Window, camera: Camera, port: Port) -> dict:
    """A row: how well masks fit the true ones (2, H, W), and what pose they give."""
    (truth, (true_ring, true_markers)), (ring, markers) = truth, seen.masks
    near = mask_within(lambda mask: mask, markers, *markers_box_px(truth[None], port, camera))
    image = np.bincount(window.pixels[: seen.events], minlength=ring.size).reshape(ring.shape)
    networks = (lambda _: ring), (lambda _: markers)
    estimate = Estimator(camera, port, "event", networks, ONE_LOOK)(image.astype(np.uint16))
    errors = pd.DataFrame(error_values([estimate], truth[None], port), columns=METRICS)
    has_pose, wrong = estimate.T_cam_port is not None, bool(is_wrong(errors)[0])
    return {
        "network": seen.network, "slices": seen.slices, "events": seen.events,
        "iou_ring": iou(binarise(ring), true_ring),
        "iou_markers": iou(near > OURS.mask_threshold, true_markers),
        "right_percent": 100.0 * (has_pose and not wrong), "wrong_percent": 100.0 * (has_pose and wrong),
    }  # fmt: skip


def fan_out(net: FilterNet) -> list[int]:
    """How many connections a pixel of the input has, and each neuron of the five layers."""
    taps = net.down[0].weight[0, 0].numel()
    down = [layer.out_channels * taps for layer in net.down]
    up = [layer.out_channels * taps for layer in net.up]
    return [down[0], down[1] + up[2], down[2] + up[1], up[0], up[1], up[2]]


@torch.inference_mode()
def ordinary_operations(net: FilterNet, window: Window, camera: Camera) -> dict[str, float]:
    """Multiply-accumulates of a histogram's mask, all and those whose input is not zero, and their energy."""
    x = padded(input_of(net, window, camera, 1))
    pairs = list(zip([x, *activations(net, x)], fan_out(net), strict=True))
    every = sum(values.numel() * n for values, n in pairs)
    needed = sum(int(torch.count_nonzero(values)) * n for values, n in pairs)
    joule = 1e-12 * (MULTIPLY_PJ + ADDITION_PJ)
    return {"operations": every, "millijoule": 1e3 * joule * every,
            "operations_needed": needed, "millijoule_needed": 1e3 * joule * needed}  # fmt: skip


@torch.inference_mode()
def spiking_operations(net: SpikingNet, window: Window, camera: Camera) -> dict[str, float]:
    """Additions of a window's mask, and their energy: one a spike and connection, and the biases'.

    A bias comes to each input of a neuron: with each slice if it is plain, once if it is signed.  A neuron
    that is pooled has four inputs.
    """
    x, fan = input_of(net, window, camera, net.slices), fan_out(net.net)
    synaptic, fired = round(SATURATION * float(x.sum())) * fan[0], 0
    for _, spikes in net.answers(x):
        counts = [int(torch.count_nonzero(values)) for values in spikes]
        synaptic, fired = synaptic + sum(np.multiply(counts, fan[1:])), fired + sum(counts)
        inputs = [values.numel() * (4 if k < 3 else 1) for k, values in enumerate(spikes)]
        biases = sum(inputs) + padded(x[:1]).numel()
    biases *= 1 if net.signed else net.slices
    joule = 1e-12 * ADDITION_PJ
    neurons = sum(values.numel() for values in spikes)
    return {"operations": float(synaptic + biases), "millijoule": 1e3 * joule * (synaptic + biases),
            "synaptic": float(synaptic), "spikes_a_neuron": fired / neurons}  # fmt: skip


def with_intervals(rows: pd.DataFrame, by: Sequence[str], seed: int = 0) -> pd.DataFrame:
    """Means of `MEASURES` by groups, each with its 95 % interval: whole sequences of each light are drawn."""
    made = []
    for key, group in rows.groupby(list(by), sort=False):
        sequences = group.sort_values(["light", "sequence"]).groupby(["light", "sequence"], sort=False)
        sums = sequences[list(MEASURES)].agg(["sum", "size"])
        lengths = sums.groupby(level="light", sort=False).size().tolist()
        drawn = np.concatenate([bootstrap.block_counts([n], 1, DRAWS, np.random.default_rng([seed, k]))
                                for k, n in enumerate(lengths)], 1)  # fmt: skip
        row = dict(zip(by, key, strict=True)) | {"windows": len(group), "sequences": len(sums)}
        for measure in MEASURES:
            totals, sizes = sums[measure, "sum"].to_numpy(), sums[measure, "size"].to_numpy()
            low, high = bootstrap.interval(drawn @ totals / (drawn @ sizes))
            row |= {measure: totals.sum() / sizes.sum(), f"{measure}_low": low, f"{measure}_high": high}
        made.append(row)
    return pd.DataFrame(made)
