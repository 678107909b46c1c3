"""Time of both filters on one image: ours against plain eager float32 networks on full frames.

Both run in inference mode and alternate; times are medians.  Masks are compared where both compute them.
"""

from __future__ import annotations

import os
import time

import numpy as np
import plain
import torch

from lmmap.estimation.images import images
from lmmap.pipeline.circle import candidates
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.masks import markers_box_px, reflector_mask
from lmmap.pipeline.network import PRECISIONS, best_precision
from lmmap.pipeline.ring import find_ring
from lmmap.pipeline.weights import FILTERS
from lmmap.recordings.formats import open_recording
from lmmap.settings import OURS
from lmmap_lab.provenance import DATA
from lmmap_lab.training.mask_quality import iou

ROUNDS = 21


def main():
    recording = open_recording(DATA / "mini" / "test-low.aedat4")
    print(f"{torch.get_num_threads()} threads, load {os.getloadavg()[0]:.1f}; best here: {best_precision()}")
    for modality in ("rgb", "event"):
        ours = {p: Estimator(recording.camera, modality=modality, precision=p) for p in PRECISIONS}
        exact = ours["float32"]
        nets = plain.nets(modality)
        _, image = list(images(recording, modality))[-5]
        port, camera = exact.port, exact.grid
        ring = find_ring(exact.ring_network(image), exact.setup)
        circles = candidates(ring.ellipse, camera, port.ring_radius_m)
        seconds = {"plain": [], **{p: [] for p in ours}}
        for _ in range(ROUNDS):
            start = time.perf_counter()
            peers = [plain.mask(net, image, modality) for net in nets]
            seconds["plain"].append(time.perf_counter() - start)
            masks = {}
            for precision, estimator in ours.items():
                start = time.perf_counter()
                masks[precision] = [
                    estimator.ring_network(image),
                    reflector_mask(estimator.reflector_network, image, circles, port, camera),
                ]
                seconds[precision].append(time.perf_counter() - start)
        box = markers_box_px(circles, port, camera)
        (left, top), (right, bottom) = (np.maximum(edge, 0).astype(int) for edge in box)
        inside = np.s_[top:bottom, left:right]
        ms = {name: 1e3 * np.median(s) for name, s in seconds.items()}
        for precision, (ring, reflectors) in masks.items():
            off = max(np.abs(peers[0] - ring).max(), np.abs((peers[1] - reflectors)[inside]).max())
            pairs = (peers[0], ring), (peers[1][inside], reflectors[inside])
            same = [iou(a > OURS.mask_threshold, b > OURS.mask_threshold) for a, b in pairs]
            print(
                f"{modality:6} {' and '.join(FILTERS)}: plain {ms['plain']:.0f} ms, {precision} "
                f"{ms[precision]:.0f} ms, {ms['plain'] / ms[precision]:.2f}x; masks differ by {off:.1e} "
                f"at most, IoU {same[0]:.4f} and {same[1]:.4f}"
            )


if __name__ == "__main__":
    main()
