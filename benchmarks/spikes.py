"""Compares spiking networks with the ordinary ones on windows of sequences that nothing was trained on.

    python benchmarks/spikes.py --trained DIR

DIR has the networks of `tuning/train_spikes.py`; without it only converted networks are compared.  Networks
see the crop around the port that a track would give them; operations and time are of whole images.  Windows
and each sequence's rows are kept in data/derived/spikes, so an interrupted run goes on.  The tables are
outcomes.csv, operations.csv and time.csv in data/results/spikes.  One processor core needs half an hour.
"""

from __future__ import annotations

import argparse
import hashlib
import time
from functools import cache
from itertools import pairwise
from pathlib import Path

import joblib
import numpy as np
import pandas as pd
import torch

from lmmap.allocator import tune_allocator
from lmmap.geometry.port import in_view
from lmmap.pipeline.weights import FILTERS, load_card, weight_path
from lmmap.types import Camera, Port
from lmmap_lab.bench.laboratory import sequence, sequence_motion
from lmmap_lab.provenance import DERIVED_DATA, ROOT, fingerprint, save_table
from lmmap_lab.studies import spikes
from lmmap_lab.studies.table1 import LIGHTS
from lmmap_lab.training.slices import make_windows

FIRST, COUNT, EACH = 50_000, 120, 2  # the first sequence's number, how many, and windows of each
COUNTED_EVERY, TIMED = 20, 3  # sequences whose operations are counted, and windows that are timed
FOLDER = DERIVED_DATA / "spikes"
CAMERA, PORT = Camera.davis346(), Port.lm_map()
WHOLE = spikes.Crop(*[(slice(0, CAMERA.height_px), slice(0, CAMERA.width_px))] * 2)


def say(line: str) -> None:
    print(f"spikes: {line}", flush=True)


def windows(name: str) -> list[tuple[spikes.Window, float]]:
    """A sequence's windows with the whole ring in view, and how fast the port moves then (mm/s)."""
    arrays = [np.load(FOLDER / "windows" / name / f"{k}.npy") for k in ("event", "event_t_us")]

    def truth_at(t_us):
        return sequence_motion(sequence(name), 1e-6 * t_us)

    found = []
    for pixels, t_us in zip(*arrays, strict=True):
        first, middle, last = truth_at(np.array([t_us[0], (t_us[0] + t_us[-1]) // 2, t_us[-1]]))
        if in_view(middle, PORT, CAMERA):
            moved_m = last.position_m - first.position_m
            speed_mm_s = 1e3 * np.linalg.norm(moved_m) / (1e-6 * (t_us[-1] - t_us[0]))
            found.append((spikes.Window(pixels, t_us, truth_at), float(speed_mm_s)))
    return found


@cache
def networks(device: str, trained: Path | None) -> dict[tuple[str, int], list]:
    """Pairs of ring and marker networks by name and T."""
    torch.backends.cudnn.allow_tf32 = False
    torch.set_num_threads(1)
    tune_allocator()
    pairs = {("ordinary", 1): [spikes.ordinary_net(name) for name in FILTERS]}
    for kind in spikes.KINDS:
        for slices in spikes.SLICES:
            pairs[f"converted, {kind}", slices] = [spikes.spiking_net(name, kind, slices) for name in FILTERS]
        paths = [trained / f"{name}-{kind}.safetensors" for name in FILTERS] if trained else []
        if paths and all(path.exists() for path in paths):
            slices, both = spikes.TRAINED_SLICES, zip(FILTERS, paths, strict=True)
            pairs[f"trained, {kind}", slices] = [
                spikes.spiking_net(n, kind, slices, path) for n, path in both
            ]
    channels_last = {"memory_format": torch.channels_last}
    return {key: [net.to(device, **channels_last) for net in nets] for key, nets in pairs.items()}


def masks(network: str, nets: list, window: spikes.Window, crop: spikes.Crop):
    """`spikes.Seen` of a crop of a window by one pair of networks."""
    of = spikes.ordinary_masks if network == "ordinary" else spikes.spiking_masks
    return of(network, nets, window, crop, CAMERA)


def judge(name: str, mark: str, device: str, trained: Path | None) -> pd.DataFrame:
    """A row for each window, network, T and number of events of a sequence."""
    path = FOLDER / "judged" / f"{name}-{mark}.csv"
    if path.exists():
        return pd.read_csv(path)
    rows = []
    for number, (window, speed_mm_s) in enumerate(windows(name)):
        facts = {"sequence": name, "light": sequence(name).light, "window": number, "speed_mm_s": speed_mm_s}
        truths, crop = spikes.truths(window, CAMERA, PORT), spikes.crop_around(window, CAMERA, PORT)
        for (network, _), nets in networks(device, trained).items():
            rows += [facts | spikes.judged(seen, truths[seen.events], window, CAMERA, PORT)
                     for seen in masks(network, nets, window, crop)]  # fmt: skip
    if rows:
        path.parent.mkdir(parents=True, exist_ok=True)
        pd.DataFrame(rows).to_csv(path, index=False)
    return pd.DataFrame(rows)


def operations(names: list[str], device: str, trained: Path | None) -> pd.DataFrame:
    """Means over a window of each sequence of what the ring's network has to add up, and its energy."""
    rows = []
    for window, _ in (found[0] for name in names if (found := windows(name))):
        for (network, slices), (net, _) in networks(device, trained).items():
            count = spikes.ordinary_operations if network == "ordinary" else spikes.spiking_operations
            rows.append({"network": network, "slices": slices} | count(net, window, CAMERA))
    return pd.DataFrame(rows).groupby(["network", "slices"], sort=False).mean().reset_index()


def timed(names: list[str]) -> pd.DataFrame:
    """Milliseconds of one processor core for ring and markers of a whole image: medians, by network and T."""
    rows = []
    for window, _ in [found for name in names for found in windows(name)][:TIMED]:
        for (network, slices), nets in networks("cpu", None).items():
            began_s = time.thread_time()
            answers = list(masks(network, nets, window, WHOLE))
            each_ms = 1e3 * (time.thread_time() - began_s) / (len(answers) if network == "ordinary" else 1)
            rows.append((network, slices, each_ms))
    table = pd.DataFrame(rows, columns=["network", "slices", "core_ms"])
    return table.groupby(["network", "slices"], sort=False).median().reset_index()


def outcomes(rows: pd.DataFrame) -> pd.DataFrame:
    """Means with intervals: of all windows, of each light, and of each third of the windows by speed."""
    speeds_mm_s = rows.drop_duplicates(["sequence", "window"]).speed_mm_s
    cuts = speeds_mm_s.quantile([0, 1 / 3, 2 / 3, 1]).to_numpy()
    third = np.clip(np.searchsorted(cuts, rows.speed_mm_s, side="right") - 1, 0, 2)
    words = [f"{low:.0f} to {high:.0f} mm/s" for low, high in pairwise(cuts)]
    groups = {
        "all": ("all", ["all"]),
        "light": (rows.light, LIGHTS),
        "speed": (np.array(words)[third], words),
    }
    by, tables = ["group", "of", "network", "slices", "events"], []
    for group, (of, order) in groups.items():
        table = rows.assign(group=group, of=of)
        table = table.sort_values("of", kind="stable", key=lambda of, order=order: of.map(order.index))
        tables.append(spikes.with_intervals(table, by))
    return pd.concat(tables, ignore_index=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--trained", type=Path)
    parser.add_argument("--count", type=int, default=COUNT, help="sequences: fewer for a trial")
    asked = parser.parse_args()
    names = [f"realistic-{n}" for n in range(FIRST, FIRST + asked.count)]
    make_windows(names, FOLDER / "windows", EACH, asked.jobs, say)
    files = sorted(asked.trained.glob("*.safetensors")) if asked.trained else []
    files = [path for path in files if ".ckpt" not in path.name]
    hashes = {path.stem: hashlib.sha256(path.read_bytes()).hexdigest()[:12] for path in files}
    hashes |= {name: load_card(weight_path(name, "event", spikes.GAP))["sha256"][:12] for name in FILTERS}
    ceilings = str(spikes.CEILINGS.relative_to(ROOT))
    mark = fingerprint(str(hashes), code=(judge, spikes), files=(ceilings,))[:12]
    tasks = (joblib.delayed(judge)(name, mark, asked.device, asked.trained) for name in names)
    parts = []
    for part in joblib.Parallel(asked.jobs, return_as="generator")(tasks):
        parts.append(part)
        say(f"{len(parts)} of {len(names)} sequences judged")
    rows = pd.concat(parts, ignore_index=True)
    counts = rows.drop_duplicates(["sequence", "window"]).light.value_counts().to_dict()
    trainings = {path.stem: load_card(path) for path in files}
    trainings = {name: {k: card["recipe"][k] for k in ("steps", "batch", "rate")} | {"commit": card["commit"]}
                 for name, card in trainings.items()}  # fmt: skip
    facts = {
        "networks": hashes,
        "trainings": trainings,
        "device": asked.device,
        "first_sequence": FIRST,
        "sequences": asked.count,
    }
    of_all = facts | {"windows": counts, "draws": spikes.DRAWS, "windows_of_a_sequence": EACH}
    save_table(spikes.RESULTS / "outcomes.csv", outcomes(rows), **of_all)
    counted = names[::COUNTED_EVERY]
    table = operations(counted, asked.device, asked.trained)
    save_table(spikes.RESULTS / "operations.csv", table, **facts, counted=counted)
    save_table(spikes.RESULTS / "time.csv", timed(names), **facts | {"device": "cpu"}, threads=1, timed=TIMED)
    say(f"{len(rows)} rows of {sum(counts.values())} windows are in {spikes.RESULTS.name}")


if __name__ == "__main__":
    main()
