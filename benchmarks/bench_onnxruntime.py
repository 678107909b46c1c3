"""From an image to a pose with the networks in ONNX Runtime, beside torch, on one core and on two.

    OMP_WAIT_POLICY=PASSIVE python benchmarks/bench_onnxruntime.py     # minutes; data/results/onnxruntime.csv

Only the networks differ: each runtime's are called by an estimator of its own, and all estimators see each
image in turn.  Times are medians over images, of the pose and, within it, of the networks.  A process of its
own has so many cores and sees no others.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # before torch: waiting threads sleep

import multiprocessing
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np
import onnxruntime
import pandas as pd
import torch

from lmmap.allocator import tune_allocator
from lmmap.cli import main as command
from lmmap.estimation.images import images
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.network import MaskNetwork, faster_precision
from lmmap.pipeline.weights import FILTERS, load_networks
from lmmap.recordings.formats import open_recording
from lmmap.settings import MODALITIES, OURS
from lmmap_lab.provenance import DATA, save_table
from lmmap_lab.studies.networks import set_hashes

RECORDING, IMAGES, LAPS, CORES = DATA / "mini" / "test-low.aedat4", 24, 3, (1, 2)
PEER = "ONNX Runtime"


class Timed:
    """A network that adds up its seconds."""

    stride_px, inputs_of = MaskNetwork.stride_px, staticmethod(MaskNetwork.inputs_of)

    def __init__(self, network):
        self.network, self.seconds = network, 0.0

    def __call__(self, image: np.ndarray) -> np.ndarray:
        start = time.perf_counter()
        mask = self.network(image)
        self.seconds += time.perf_counter() - start
        return mask


def exported(path: Path, threads: int):
    """A network that ``lmmap export`` wrote, as an estimator calls it."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    session = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])

    def mask(image: np.ndarray) -> np.ndarray:
        planes = image.transpose(2, 0, 1) if image.ndim == 3 else image[None]
        return session.run(["mask"], {"image": np.ascontiguousarray(planes, np.float32)[None]})[0][0, 0]

    return mask


def measure(modality: str, cores: int, folder: Path) -> list[dict]:
    """A row for each runtime: its times on the recording's images, and how far its poses are from
    those of the first, torch in float32."""
    tune_allocator()  # as the command does
    torch.set_num_threads(cores)
    recording = open_recording(RECORDING)
    pairs = {("torch", p): load_networks(OURS.weights, modality, p)
             for p in dict.fromkeys(("float32", faster_precision()))}  # fmt: skip
    pairs[PEER, "float32"] = [exported(folder / f"{name}-{modality}.onnx", cores) for name in FILTERS]
    pairs = {runtime: [Timed(network) for network in pair] for runtime, pair in pairs.items()}
    ways = {
        runtime: Estimator(recording.camera, None, modality, tuple(pair)) for runtime, pair in pairs.items()
    }
    whole, part, answers = ({runtime: [] for runtime in ways} for _ in range(3))
    shown = list(images(recording, modality))[:IMAGES]
    for lap in range(LAPS + 1):  # the first warms up
        for t_us, image in shown:
            for runtime, estimator in ways.items():
                before, start = sum(n.seconds for n in pairs[runtime]), time.perf_counter()
                answer = estimator(image, t_us)
                if lap:
                    whole[runtime].append(time.perf_counter() - start)
                    part[runtime].append(sum(n.seconds for n in pairs[runtime]) - before)
                else:
                    answers[runtime].append(answer)
    rows, exact = [], next(iter(answers.values()))
    for way in ways:
        poses = [[e.T_cam_port for e in both] for both in zip(exact, answers[way], strict=True)]
        apart_m = [np.linalg.norm(a.position_m - b.position_m) for a, b in poses if a and b]
        pose_ms, networks_ms = (1e3 * np.median(seconds[way]) for seconds in (whole, part))
        rows.append({
            "cores": cores, "modality": modality, "runtime": way[0], "precision": way[1],
            "images": len(shown), "pose_ms": pose_ms, "networks_ms": networks_ms, "poses": len(apart_m),
            "one_pose": sum((a is None) != (b is None) for a, b in poses), "apart_mm": 1e3 * max(apart_m),
        })  # fmt: skip
    return rows


def main() -> None:
    load = os.getloadavg()[0]
    print(f"load before this ran: {load:.1f} (its times mean little above 0.5)")
    rows, usable = [], sorted(os.sched_getaffinity(0))
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place, "onnx")
        assert command.main(["export", OURS.weights, "-o", str(folder)]) == 0
        for cores in (n for n in CORES if n <= len(usable)):
            os.sched_setaffinity(0, usable[:cores])  # the process below begins with it
            for modality in MODALITIES:
                with multiprocessing.get_context("spawn").Pool(1) as alone:
                    rows += alone.apply(measure, (modality, cores, folder))
    table = pd.DataFrame(rows)
    processor = torch.cpu.get_capabilities().get("cpu_name", "unknown")
    facts = {"networks": set_hashes(OURS.weights), "load": round(load, 1), "processor": processor,
             "onnxruntime": version("onnxruntime")}  # fmt: skip
    save_table(DATA / "results" / "onnxruntime.csv", table, **facts)
    for (cores, modality), same in table.groupby(["cores", "modality"]):
        torch_ms, peer_ms = (same.pose_ms[same.runtime == name].min() for name in ("torch", PEER))
        print(f"{cores} cores, {modality:5}: torch at its best {torch_ms:.0f} ms, {PEER} {peer_ms:.0f} ms")
    print(table.to_string(index=False))


if __name__ == "__main__":
    main()
