"""Event updates between images: how long one takes, and what it is made of.

    python benchmarks/bench_between.py [SECONDS]

Events of a fast port, thinned or repeated to the rates below, are given to a track in pieces of one update.
Times are processor times of one thread, so that other processes do not count.  Peers, in the same run: the
ring's distances in numpy instead of the compiled kernel, and an estimate of a histogram.
"""

from __future__ import annotations

import sys
import time

import numpy as np
import torch

from lmmap.geometry.port import on_plane
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.histograms import histogram
from lmmap.pipeline.network import faster_precision
from lmmap.settings import OURS
from lmmap.tracking.between import Between
from lmmap.tracking.edges import EdgeFinder
from lmmap.types import Estimate, Port, Status
from lmmap_lab.bench import sequences
from lmmap_lab.studies.between_images import SETUP

NAME, MEV_S = "speed-150-103", (0.5, 1.5, 4.0)
GOOD = np.diag([1e-3, 1e-3, 2e-3, 0.01, 0.01, 0.01]) ** 2


def at_rate(events, mev_s: float, rng) -> np.ndarray:
    """Events thinned, or drawn more often, to a mean rate; their times stay."""
    span_s = 1e-6 * (events["t_us"][-1] - events["t_us"][0])
    chosen = np.sort(rng.integers(0, len(events), int(1e6 * mev_s * span_s)))
    return events[chosen]


def started(recording, port: Port) -> Between:
    """A track that knows pose and velocity from true poses of the first 0.2 s."""
    track = Between(recording.camera, port)
    for t_us in range(0, 200_001, 50_000):
        T = recording.truth.at(np.array([t_us]))[0]
        track.add({"event": Estimate(t_us, Status.OK, T, covariance=GOOD, confidence=0.99)})
    return track


def in_numpy(events, T_cam_port, port: Port, camera, gate_px: float) -> int:
    """The peer of the kernel: events within a gate of the ring's edges, by array operations."""
    pixels = np.stack([events["x"], events["y"]], -1).astype(float)
    radius_m = np.linalg.norm(on_plane(pixels, T_cam_port, 0.0, camera), axis=-1)
    scale = camera.fx_px / T_cam_port.position_m[2]
    edges_m = np.array([port.ring_inner_radius_m, port.ring_outer_radius_m])
    return int(np.sum(np.abs(radius_m[:, None] - edges_m).min(1) * scale < gate_px))


def median_s(function, repeats: int = 30) -> float:
    function()
    times = []
    for _ in range(repeats):
        start = time.thread_time()
        function()
        times.append(time.thread_time() - start)
    return float(np.median(times))


def main(seconds: float) -> None:
    torch.set_num_threads(1)
    rng, port = np.random.default_rng(0), Port.lm_map()
    recording = sequences.simulate(NAME, seconds, setup=SETUP)
    first = np.searchsorted(recording.events["t_us"], 200_000)
    step_us, camera = OURS.between.period_us, recording.camera
    print(" Mev/s  updates  ms each  95 % ms  updates/s  times real time  at edges")
    for mev_s in MEV_S:
        events, track = at_rate(recording.events[first:], mev_s, rng), started(recording, port)
        cuts = np.flatnonzero(np.diff(events["t_us"] // step_us)) + 1
        took_s, updates = [], 0
        for piece in np.split(events, cuts):
            start = time.thread_time()
            updates += track.events(piece)
            took_s.append(time.thread_time() - start)
        mean_s = np.mean(took_s[2:])
        share = 1e-6 * step_us / mean_s
        each_ms, slow_ms = 1e3 * np.median(took_s), 1e3 * np.quantile(took_s, 0.95)
        print(f"{mev_s:6.1f} {updates:8d} {each_ms:8.2f} {slow_ms:8.2f} {1 / mean_s:10.0f} {share:16.1f}"
              f" {100 * track.used / len(events):7.0f} %")  # fmt: skip

    events = at_rate(recording.events[first:], 1.5, rng)[: int(1.5 * step_us)]
    T, finder = recording.truth.at(np.array([200_000]))[0], EdgeFinder(port, camera)
    usable = finder.edges.visible(T, port, camera)
    window = recording.events[first:][: OURS.events_per_window]
    estimator = Estimator(camera, modality="event", precision=faster_precision())
    image = histogram(window["x"], window["y"], camera.size_px)
    rows = {
        f"kernel, {len(events)} events": lambda: finder(events, T, usable, 2.5),
        "  peer: numpy, the ring alone": lambda: in_numpy(events, T, port, camera, 2.5),
        "Jacobian of all edges": lambda: finder.edges.jacobian(T, camera),
        "which edges are hidden (every 10 ms)": lambda: finder.edges.visible(T, port, camera),
        "  peer: a histogram's pose": lambda: estimator(image),
    }
    for name, function in rows.items():
        print(f"{name:40s} {1e3 * median_s(function):8.3f} ms")


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 1.0)
