"""What a ring network finds on printed and glossy panels, by what it is shown of the events.

    python tuning/judge_inputs.py samples FOLDER           # 240 sequences of printed covers, an hour
    python tuning/judge_inputs.py train FOLDER polarity    # a network, a quarter of an hour on one core
    python tuning/judge_inputs.py train FOLDER further     # robust's filter on slim's sequences, an hour
    python tuning/judge_inputs.py judge FOLDER             # data/results/inputs.csv, ring-contrast.csv

Inputs are counts of events, counts of each polarity, or counts beside a time surface.  Their networks have
half the channels and equal batches of printed covers; ``few`` is counts on half of the covers.  They are
judged on scenes of the bench and of `validation_world` in high light: a circle is right if one of its two
poses has centre and normal within the limits of `OURS`.  The ring's contrast is its events per pixel in units
of those between 1.2 and 1.8 of its radii.  An interrupted step goes on.
"""

from __future__ import annotations

import argparse
import pickle
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from unittest import mock

import cv2
import numpy as np
import pandas as pd
import torch
import validation_world as world
from safetensors.torch import load_file

from lmmap.estimation.images import timed_images
from lmmap.geometry.port import in_view
from lmmap.geometry.projection import project_points
from lmmap.geometry.rotations import angle_between_rad
from lmmap.pipeline import circle
from lmmap.pipeline.image_estimator import settings_for
from lmmap.pipeline.network import SATURATION, FilterNet, encode
from lmmap.pipeline.ring import find_ring
from lmmap.pipeline.setup import Setup
from lmmap.pipeline.weights import load_network, weight_path
from lmmap.settings import OURS, PAPER
from lmmap.types import Camera, Port, Status
from lmmap_lab.bench import cad, labels, laboratory, renderer, sequences, skins, varied
from lmmap_lab.provenance import DATA, DERIVED_DATA, save_table
from lmmap_lab.training import dataset
from lmmap_lab.training.recipe import Recipe
from lmmap_lab.training.train import train

SIGN = 24  # the bit of a sampled pixel that says whether it became brighter
COVERS, STEPS, RATE, TAU = 240, 4000, 3e-3, 0.25  # TAU: decay of the time surface, in windows
SCENES, SECONDS, FIRST = 8, 3.0, {"bench": 81_002, "second": 84_002}  # every third one is in high light
CAMERA, PORT = Camera.davis346(), Port.lm_map()
SHAPE = CAMERA.size_px[::-1]
AGAINST = {"further": "robust"}  # what a network is compared with; all others with counts


def planes(kind: str, pixels: np.ndarray) -> np.ndarray:
    """Counts (H, W), or (H, W, 2): of each polarity, or counts and how near in time the nearest event is."""
    pixels = pixels[pixels != dataset.NO_EVENT]
    at, size = pixels & (2**SIGN - 1), SHAPE[0] * SHAPE[1]
    if kind == "polarity":
        on = (pixels >> SIGN).astype(bool)
        layers = [np.bincount(at[m], minlength=size) for m in (on, ~on)]
    elif kind == "surface":
        first = np.full(size, np.inf)
        np.minimum.at(first, at, np.arange(len(at)) / len(at))  # events come by their distance in time
        layers = [np.bincount(at, minlength=size), SATURATION * np.exp(-first / TAU)]
    else:
        return np.bincount(at, minlength=size).reshape(SHAPE).astype(np.float32)
    return np.stack(layers, -1).reshape(*SHAPE, 2).astype(np.float32)


def encoded(x: np.ndarray, modality: str = "event") -> torch.Tensor:
    """`network.encode` of each layer (N, H, W[, C])."""
    layers = [x] if x.ndim == 3 else [np.ascontiguousarray(x[..., k]) for k in range(x.shape[-1])]
    return torch.cat([encode(layer, modality) for layer in layers], 1)


def samples_of(kind: str) -> type[dataset.Samples]:
    class Samples(dataset.Samples):
        def image(self, index, events=PAPER.events_per_window):
            name, i = self._places[index]
            return planes(kind, np.asarray(self._array(name)[i][:events]))

    return Samples


def network_of(kind: str):
    def make(channels: int, prior: float) -> FilterNet:
        return FilterNet(
            1 if kind in ("counts", "few") else 2, prior, Recipe("ring", "event", width=0.5).widths
        )

    make.__name__ = kind
    return make


def signed_events(recording, count: int) -> tuple[np.ndarray, list[int]]:
    """`dataset.sample_events` with each event's sign."""
    events, core = recording.events, PAPER.events_per_window
    most, rows, mids = min(dataset.MOST_EVENTS, len(events)), [], []
    for start in dataset.spread(len(events) - most + 1, count) if most >= core else ():
        piece, first = events[start : start + most], (most - core) // 2
        mid_us = (int(piece["t_us"][first]) + int(piece["t_us"][first + core - 1])) // 2
        away_us = np.abs(piece["t_us"] - mid_us)
        order = np.argsort(away_us, kind="stable")
        reach_us = min(mid_us - piece["t_us"][0], piece["t_us"][-1] - mid_us)
        order = order[: max(np.count_nonzero(away_us <= reach_us), core)]
        row = np.full(dataset.MOST_EVENTS, dataset.NO_EVENT, np.uint32)
        row[: len(order)] = signed(piece[order])
        rows.append(row)
        mids.append(mid_us)
    return np.array(rows, np.uint32).reshape(-1, dataset.MOST_EVENTS), mids


def signed(events: np.ndarray) -> np.ndarray:
    at = events["y"].astype(np.uint32) * CAMERA.width_px + events["x"]
    return at | (events["p"] > 0).astype(np.uint32) << SIGN


def make_samples(folder: Path) -> None:
    for name in (f"printed-{k}" for k in range(COVERS)):
        if not (folder / name).is_dir():
            port = varied.draw_port(varied.base_sequence(name))
            with mock.patch.object(dataset, "sample_events", signed_events):
                arrays = dataset.sample_recording(varied.record_varied(name, port=port), 4, port)
            kept = {k: v for k, v in arrays.items() if k.startswith("event")}
            dataset.write_samples(folder / name, kept, "printed")
            print(name, flush=True)


def train_one(kind: str, folder: Path, samples: Path) -> None:
    path = folder / kind / "ring.safetensors"
    path.parent.mkdir(parents=True, exist_ok=True)
    if kind == "further":
        recipe = Recipe("ring", "event", "slim", steps=7000, rate=1e-3, start_from="robust")
        train(recipe, DERIVED_DATA / "training", weights=path)
        return
    names = [f"printed-{k}" for k in range(COVERS // 2 if kind == "few" else COVERS)]
    recipe = Recipe("ring", "event", "low", steps=STEPS, rate=RATE, width=0.5)
    train(recipe, samples, weights=path, names=names, network=network_of(kind), samples_of=samples_of(kind),
          encode=encoded)  # fmt: skip


def glossy_panel(seq, port: Port):
    """A plain panel of high gloss: lacquer, metal."""
    rng = seq.rng("glossy panel")
    at = rng.uniform(-1, 1, 2) * [0.1, 0.05]
    skin = skins.film(port.panel_size_m, at, rng)
    skin[..., skins.SLOPE] *= rng.uniform(0, 1.5)
    skin[..., skins.DIFFUSE] = rng.uniform(0.02, 0.4)
    skin[..., skins.SPECULAR] = varied._log_uniform(rng, 0.1, 0.9) * varied._hue(rng, 0.6)
    skin[..., skins.ROUGHNESS] = varied._log_uniform(rng, 0.05, 0.25)
    return cad.solid(port, rng.uniform(-1, 1, 2) * [0.10, 0.05]), skin


def simulated(place: str, k: int):
    """A recording in high light: every fourth panel is glossy, all others are printed."""
    seq = laboratory.sequence(f"{'augmented' if k % 2 else 'realistic'}-{FIRST[place] + 3 * k}")
    cover = glossy_panel if k % 4 == 3 else varied.printed_panel
    if place == "bench":
        rng = seq.rng("varied")
        render, blur_px = varied.PaintedPort.draw(rng), rng.uniform(0.4, 1.1)
        setup = sequences.Setup(cover, varied.lamps, varied.backdrop, render, blur_px)
        sensor = varied.draw_sensor(rng)
    else:
        gap_m, sensor = list(world.WORLDS.values())[k % len(world.WORLDS)]
        setup = replace(world.other_setup(gap_m), panel=cover)
    return sequences.simulate(seq.name, SECONDS, sensor=sensor, setup=setup)


def scene(place: str, k: int, folder: Path) -> list:
    """Of each histogram that shows the port: its signed events by distance in time, and the true pose."""
    path = folder / "scenes" / f"{place}-high-{k}.pkl"
    if path.exists():
        return pickle.loads(path.read_bytes())
    recording, rows = simulated(place, k), []
    events, truth = recording.events, recording.truth
    for shot in timed_images(recording, "event"):
        T = truth.at(np.clip([shot.t_us], *truth.t_us[[0, -1]]))[0]
        if not in_view(T, PORT, CAMERA):
            continue
        last = len(events) - PAPER.events_per_window
        mids_us = (events["t_us"][: last + 1] + events["t_us"][PAPER.events_per_window - 1 :]) // 2
        for start in range(*np.searchsorted(mids_us, [shot.t_us, shot.t_us + 1])):
            window = events[start : start + PAPER.events_per_window]
            if np.array_equal(planes("counts", signed(window)), shot.image):
                order = np.argsort(np.abs(window["t_us"] - shot.t_us), kind="stable")
                rows.append((signed(window[order]), T))
                break
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(pickle.dumps(rows))
    return rows


def right(mask: np.ndarray, T, setup: Setup) -> bool:
    ring = find_ring(mask, setup)
    if isinstance(ring, Status):
        return False
    found = circle.poses(ring.ellipse, CAMERA, PORT.ring_radius_m)
    return any(
        np.linalg.norm(found[k].position_m - T.position_m) < OURS.right_position_m
        and angle_between_rad(found[k].normal, T.normal) < OURS.right_normal_rad
        for k in (0, 1)
    )


def contrast(counts: np.ndarray, ring: np.ndarray, T) -> float:
    """Events per pixel on the true ring, in units of those around it."""
    angles = np.linspace(0, 2 * np.pi, 90)
    rim = PORT.ring_radius_m * np.stack([np.cos(angles), np.sin(angles), 0 * angles], -1)
    discs = []
    for radii in (1.2, 1.8):
        outline = np.rint(project_points(T, radii * rim, CAMERA)).astype(np.int32)
        discs.append(cv2.fillPoly(np.zeros(SHAPE, np.uint8), [outline], 1))
    ring = cv2.dilate(ring.astype(np.uint8), np.ones((3, 3))) > 0
    around = (discs[1] > discs[0]) & ~ring
    return counts[ring].mean() / max(counts[around].mean(), 1e-3)


def networks(folder: Path) -> dict:
    """By name: the input's kind, and a function from input to mask."""
    found = {}
    for kind in ("few", "counts", "polarity", "surface"):
        net = network_of(kind)(1, 0.01)
        path = folder / kind / "ring.safetensors"
        net.load_state_dict(load_file(path))
        found[kind] = (kind, partial(mask_of, net.eval()))
    paths = {name: weight_path("ring", "event", name) for name in ("slim", "robust")}
    for name, path in (paths | {"further": folder / "further" / "ring.safetensors"}).items():
        net = load_network(path, "event", "float32")
        found[name] = ("counts", lambda x, net=net: net(x.astype(np.uint16)))
    return found


@torch.inference_mode()
def mask_of(net: torch.nn.Module, x: np.ndarray) -> np.ndarray:
    return torch.sigmoid(net(encoded(x[None])))[0, 0].numpy()


@cache
def rays():
    return renderer.ray_grid(CAMERA, 4)


def judge(folder: Path, draws: int = 2000) -> None:
    setup, rows, nets = Setup(PORT, CAMERA, "event", settings_for(CAMERA)), [], networks(folder)
    for place in FIRST:
        for k in range(SCENES):
            for i, (pixels, T) in enumerate(scene(place, k, folder)):
                ring = np.asarray(labels.label_masks(T, PORT, CAMERA, rays())[0]) > 0
                own = contrast(planes("counts", pixels), ring, T)
                of = {"scene": f"{place}-{k}", "i": i, "contrast": own}
                rows += [of | {"network": name, "right": right(mask(planes(kind, pixels)), T, setup)}
                         for name, (kind, mask) in nets.items()]  # fmt: skip
            print(place, k, flush=True)
    table = pd.DataFrame(rows)
    by = table.pivot(index=["scene", "i"], columns="network", values="right").astype(float)
    rng, scenes, found = np.random.default_rng(0), by.index.unique("scene"), []
    for name in nets:
        gain = by[name] - by[AGAINST.get(name, "counts")]
        sums = gain.groupby("scene").agg(["sum", "size"])
        drawn = [sums.loc[rng.choice(scenes, len(scenes))].sum() for _ in range(draws)]
        low, high = np.percentile([100 * d["sum"] / d["size"] for d in drawn], [2.5, 97.5])
        own = {"network": name, "histograms": len(by), "scenes": len(scenes)}
        own |= {"right_percent": 100 * by[name].mean(), "gain": 100 * gain.mean()}
        found.append(own | {"gain_low": low, "gain_high": high})
    save_table(DATA / "results" / "inputs.csv", pd.DataFrame(found))
    robust = table[table.network == "robust"]
    bins = pd.cut(robust.contrast, [0, 1.5, 2, 3, np.inf], right=False)
    grouped = robust.groupby(bins, observed=True).right.agg(["size", "mean"])
    shares = {"histograms": grouped["size"].to_numpy(), "right_percent": 100 * grouped["mean"].to_numpy()}
    limits = {"from": [b.left for b in grouped.index], "to": [b.right for b in grouped.index]}
    save_table(DATA / "results" / "ring-contrast.csv", pd.DataFrame(limits | shares))
    print(pd.DataFrame(found).round(1).to_string(), grouped, sep="\n")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("step", choices=["samples", "train", "judge"])
    parser.add_argument("folder", type=Path, help="samples, weights and scenes; kept between calls")
    parser.add_argument("kind", nargs="?", choices=["counts", "few", "polarity", "surface", "further"])
    a = parser.parse_args()
    torch.set_num_threads(1)
    if a.step == "samples":
        make_samples(a.folder / "samples")
    elif a.step == "train":
        train_one(a.kind or "counts", a.folder, a.folder / "samples")
    else:
        judge(a.folder)


if __name__ == "__main__":
    main()
