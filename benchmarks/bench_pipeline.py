"""Image in, pose out, stage by stage: ours against the plain path in the same run.

    OMP_WAIT_POLICY=PASSIVE python benchmarks/bench_pipeline.py

The plain path is the paper's: eager float32 networks on full frames, its RANSAC loop, printed formula and
grid of yaws.  Both run on every image in turn; medians over images.  Histograms are made from events by both.
A recording is estimated two images at a time: that rate is the pipeline's.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")  # before torch: waiting threads sleep

import time
from pathlib import Path

import numpy as np
import plain
import torch

from lmmap.estimation.estimates import estimate_images
from lmmap.estimation.images import TimedImage, images
from lmmap.pipeline import circle, outline, yaw
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.histograms import histogram
from lmmap.pipeline.judge import judge
from lmmap.pipeline.masks import Seen, reflector_mask
from lmmap.pipeline.network import faster_precision
from lmmap.pipeline.refine import refine
from lmmap.pipeline.ring import find_ring, skeleton_points
from lmmap.pipeline.weights import FILTERS
from lmmap.recordings.formats import open_recording
from lmmap.refinement.contour import Contour
from lmmap.settings import PAPER
from lmmap_lab.provenance import DATA

IMAGES, LAPS = 24, 4
GOAL_HZ = {True: 25.0, False: 15.0}  # with bfloat16 in the processor, and without
PAPER_HZ, LEAST_RATIO = 10.0, 4.0


class Watch:
    """Seconds by stage, of one image after another."""

    def __init__(self):
        self.seconds: dict[str, list[float]] = {}
        self.processor_s: dict[str, list[float]] = {}

    def __call__(self, stage: str, function, *arguments, **options):
        start, used = time.perf_counter(), time.process_time()
        answer = function(*arguments, **options)
        self.processor_s.setdefault(stage, []).append(time.process_time() - used)
        self.seconds.setdefault(stage, []).append(time.perf_counter() - start)
        return answer

    def ms(self) -> dict[str, float]:
        return {stage: 1e3 * float(np.median(s)) for stage, s in self.seconds.items()}


def papers(watch: Watch, nets, estimator: Estimator, image: np.ndarray) -> bool:
    """The paper's procedure; whether it came to a pose."""
    camera, port, modality = estimator.camera, estimator.port, estimator.modality
    ring, reflectors = (
        watch(f"{n} filter", plain.mask, net, image, modality) for n, net in zip(FILTERS, nets, strict=True)
    )
    points = watch("skeleton", skeleton_points, ring)
    fitted, _ = watch("ellipse", plain.ransac_loop, points, np.random.default_rng(0))
    if fitted is None:
        return False
    poses = watch("circle", circle.paper_poses, fitted, camera, port.ring_radius_m)
    watch("yaw", yaw.paper_yaw, reflectors, poses, port, camera)
    return True


def ours(watch: Watch, estimator: Estimator, image: np.ndarray) -> None:
    """The stages that `Estimator.on_grid` goes through, one by one."""
    port, grid, modality, settings = estimator.port, estimator.grid, estimator.modality, estimator.settings
    of_port = port, grid, modality, settings
    mask = watch("ring filter", estimator.ring_network, image)
    edges = watch("edges of the image", outline.edges, image)
    ring = watch("skeleton, ellipse", find_ring, mask, port, grid, settings)
    if not isinstance(ring, Contour):
        return
    circles = watch("circle", circle.candidates, ring.ellipse, grid, port.ring_radius_m)
    reflectors = watch("reflector filter", reflector_mask, estimator.reflector_network, image, circles, port,
                       grid, settings.marker_border_px)  # fmt: skip
    weights = settings.yaw_weights[modality]
    fit = watch("yaw", yaw.fast_yaw, reflectors, circles[:2], port, grid, settings, edges, weights)
    if fit.score >= settings.min_marker_score:
        refined = watch("refinement", refine, fit, ring, reflectors, edges, *of_port)
        seen = Seen(mask, edges)
        watch("confidence", judge, 0, image, seen, reflectors, ring, fit, refined, *of_port)


def has_bfloat16() -> bool:
    info = Path("/proc/cpuinfo")
    return info.exists() and any(flag in info.read_text() for flag in ("avx512_bf16", "amx_bf16"))


def main() -> None:
    recording = open_recording(DATA / "mini" / "test-low.aedat4")
    goal = GOAL_HZ[has_bfloat16()]
    threads, bits = torch.get_num_threads(), "with" if has_bfloat16() else "without"
    print(f"{threads} threads, processor {bits} bfloat16; the paper: {PAPER_HZ:g} Hz with a GPU")
    print(f"load before this ran: {os.getloadavg()[0]:.1f} (its times mean little above 0.5)")
    window = recording.events[: PAPER.events_per_window]
    for modality in ("rgb", "event"):
        estimator, nets = (
            Estimator(recording.camera, modality=modality, precision=faster_precision()),
            plain.nets(modality),
        )
        shots = [image for _, image in images(recording, modality)][:IMAGES]
        answers = [estimator(image) for image in shots[:3]]  # warms up, too
        papers(Watch(), nets, estimator, shots[0])
        stages, peer, whole, peer_whole, binning = Watch(), Watch(), Watch(), Watch(), Watch()
        for image in shots:
            if modality == "event":
                binning("histogram", histogram, window["x"], window["y"], recording.camera.size_px)
            answers.append(whole("whole", estimator, image))
            peer_whole("whole", papers, peer, nets, estimator, image)
            ours(stages, estimator, image)
        bin_ms = binning.ms().get("histogram", 0.0)
        a, b = whole.ms()["whole"] + bin_ms, peer_whole.ms()["whole"] + bin_ms
        poses = sum(e.T_cam_port is not None for e in answers[3:])
        print(f"\n{modality}: {poses} poses in {len(shots)} images")
        print(f"  {'ms':24}{'ours':>8}{'plain':>8}")
        mine, theirs = stages.ms() | binning.ms(), peer.ms() | binning.ms()
        for stage in dict.fromkeys([*mine, *theirs]):
            cells = (f"{s[stage]:8.2f}" if stage in s else f"{'-':>8}" for s in (mine, theirs))
            print(f"  {stage:24}" + "".join(cells))
        print(f"  {'image to pose':24}{a:8.2f}{b:8.2f}")
        start = time.perf_counter()
        for _ in estimate_images((TimedImage(k, image) for k, image in enumerate(LAPS * shots)), estimator):
            pass
        each = 1e3 * (time.perf_counter() - start) / (LAPS * len(shots)) + bin_ms
        good = 1e3 / each >= goal and b / each >= LEAST_RATIO
        used = [1e3 * float(np.median(w.processor_s["whole"])) for w in (whole, peer_whole)]
        print(f"  {'of all processors':24}{used[0]:8.2f}{used[1]:8.2f}")
        print(f"  plain {1e3 / b:.1f} Hz; ours one by one {1e3 / a:.1f} Hz ({b / a:.1f}x), two at a time "
              f"{1e3 / each:.1f} Hz ({b / each:.1f}x); goal {goal:g} Hz and {LEAST_RATIO:g}x: "
              f"{'reached' if good else 'NOT reached'}")  # fmt: skip


if __name__ == "__main__":
    main()
