"""One image after another: the tracker against its estimator frame by frame and the plain path.

    OMP_WAIT_POLICY=PASSIVE python benchmarks/bench_tracker.py [--weights NAME]

Each goes through the recording by itself, one image at a time, as it would in use; they take turns, lap by
lap, in bfloat16 and in float32, on two cores and on one.  Medians over images.  The plain path is the paper's
steps: eager float32 networks on full frames, its RANSAC loop, printed formula and grid of yaws.  What the
binning of a histogram takes is added to each.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # before torch: waiting threads sleep

import time
from collections import defaultdict

import cv2
import numpy as np
import plain
import torch

from lmmap.allocator import tune_allocator
from lmmap.estimation.images import timed_images
from lmmap.pipeline import circle, yaw
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.histograms import histogram
from lmmap.pipeline.network import faster_precision
from lmmap.pipeline.ring import skeleton_points
from lmmap.recordings.formats import open_recording
from lmmap.settings import OURS, PAPER
from lmmap.tracking.tracker import Tracker
from lmmap.types import Status
from lmmap_lab.provenance import DATA

GOALS = {"bfloat16": (50.0, 10.0), "float32": (30.0, 1.0)}  # on two cores: Hz, and times the plain path
WARM, LAPS = 3, {"plain": 1, "frame by frame": 2, "tracker": 4}  # images of a lap that do not count, and laps


def keep_to(cores: list[int]) -> None:
    """Run on these processor cores, with as many threads."""
    os.sched_setaffinity(0, cores)
    torch.set_num_threads(len(cores))
    cv2.setNumThreads(len(cores))


def papers(nets, estimator: Estimator, image: np.ndarray) -> None:
    """The paper's procedure."""
    ring, reflectors = (plain.mask(net, image, estimator.modality) for net in nets)
    fitted, _ = plain.ransac_loop(skeleton_points(ring), np.random.default_rng(0))
    if fitted is not None:
        poses = circle.paper_poses(fitted, estimator.camera, estimator.port.ring_radius_m)
        yaw.paper_yaw(reflectors, poses, estimator.port, estimator.camera)


def run(recording, modality: str, precision: str, weights: str) -> dict[str, float]:
    """Median ms of an image by each way, and the tracker's share of answers that are ok."""
    estimator = Estimator(recording.camera, modality=modality, weights=weights, precision=precision)
    shots, nets = list(timed_images(recording, modality)), plain.nets(modality)
    statuses, seconds = [], defaultdict(list)

    def watch(name, function, *arguments) -> None:
        start = time.perf_counter()
        function(*arguments)
        seconds[name].append(time.perf_counter() - start)

    for lap in range(max(LAPS.values())):
        tracker = Tracker(estimator)
        ways = {
            "plain": lambda shot: papers(nets, estimator, shot.image),
            "frame by frame": lambda shot: estimator(shot.image, shot.t_us),
            "tracker": lambda shot, tracker=tracker: statuses.append(tracker(shot.image, shot.t_us).status),
        }
        for name, way in ways.items():
            for k, shot in enumerate(shots if lap < LAPS[name] else ()):
                watch(name if k >= WARM else "warm", way, shot)
    if modality == "event":
        events = recording.events[: PAPER.events_per_window]
        for _ in shots:
            watch("binning", histogram, events["x"], events["y"], recording.camera.size_px)
    ms = {name: 1e3 * float(np.median(times)) for name, times in seconds.items()}
    ms = {name: ms[name] + ms.get("binning", 0.0) for name in LAPS}
    return ms | {"ok_percent": 100 * float(np.mean([status == Status.OK for status in statuses]))}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--weights", default=OURS.weights, help="set of networks, or their folder")
    weights = parser.parse_args().weights
    tune_allocator()  # as the command does
    recording, cores = open_recording(DATA / "mini" / "test-low.aedat4"), sorted(os.sched_getaffinity(0))
    print(f"weights {weights}, in {faster_precision()} by default here")
    print(f"load before this ran: {os.getloadavg()[0]:.1f} (its times mean little above 0.5)")
    for count in sorted({min(2, len(cores)), 1}, reverse=True):
        keep_to(cores[:count])
        for precision in GOALS:
            for modality in ("rgb", "event"):
                ms = run(recording, modality, precision, weights)
                goal = verdict(ms, precision) if count == 2 and weights == OURS.weights else ""
                print(f"cores {count}: {precision:9}{modality:6}{line(ms)}{goal}", flush=True)


def line(ms: dict[str, float]) -> str:
    alone_ms, mine_ms, plain_ms = ms["frame by frame"], ms["tracker"], ms["plain"]
    return (f"plain {plain_ms:6.1f} ms, frame by frame {alone_ms:5.1f} ms, tracker {mine_ms:5.1f} ms = "
            f"{1e3 / mine_ms:5.1f} Hz: {plain_ms / mine_ms:4.1f}x plain, {alone_ms / mine_ms:3.1f}x frame by "
            f"frame, ok {ms['ok_percent']:.0f} %")  # fmt: skip


def verdict(ms: dict[str, float], precision: str) -> str:
    goal_hz, goal_ratio = GOALS[precision]
    reached = 1e3 / ms["tracker"] >= goal_hz and ms["plain"] / ms["tracker"] >= goal_ratio
    return f"; goal {goal_hz:g} Hz and {goal_ratio:g}x: {'reached' if reached else 'NOT reached'}"


if __name__ == "__main__":
    main()
