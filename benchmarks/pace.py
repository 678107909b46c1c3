"""How many images a second this machine turns into poses, beside the paper's 10 Hz.

    python benchmarks/pace.py            # a minute; prints
    python benchmarks/pace.py --save     # also data/results/pace.csv

One core, and the processor time of an image: the median over images of the committed recording, so that
other work on the machine hardly counts.  The last precision is that of `lmmap estimate` here.  Beside the
estimator and the tracker stand two parts of the paper's procedure: its RANSAC, one hypothesis after another,
and its grid of yaws.  The memory is the most that the process had.
"""

from __future__ import annotations

import argparse
import resource
from itertools import islice
from pathlib import Path
from time import process_time

import numpy as np
import pandas as pd
import plain
import torch

from lmmap.allocator import tune_allocator
from lmmap.estimation.images import images
from lmmap.pipeline import circle, yaw
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.network import faster_precision
from lmmap.pipeline.ring import skeleton_points
from lmmap.recordings.formats import open_recording
from lmmap.settings import MODALITIES
from lmmap.tracking.tracker import Tracker
from lmmap_lab.provenance import DATA, save_table

RECORDING, IMAGES, WARM = DATA / "mini" / "test-low.aedat4", 24, 3
PARTS = ("image to pose", "tracker", "their RANSAC", "their grid of yaws")


def processor() -> str:
    """The processor's name, where Linux tells it."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    return next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), "unknown")


def took_ms(function, *arguments):
    began_s = process_time()
    answer = function(*arguments)
    return 1e3 * (process_time() - began_s), answer


def times_ms(recording, modality: str, precision: str) -> pd.DataFrame:
    """Processor time of each of `PARTS`, a row an image."""
    estimator = Estimator(recording.camera, modality=modality, precision=precision)
    tracker, rows = Tracker(estimator), []
    for t_us, image in islice(images(recording, modality), WARM + IMAGES):
        alone_ms, estimate = took_ms(estimator, image, t_us)
        tracked_ms, _ = took_ms(tracker, image, t_us)
        points_px = skeleton_points(estimator.ring_network(image))
        ransac_ms, (ring, _) = took_ms(plain.ransac_loop, points_px, np.random.default_rng(0))
        if estimate.T_cam_port is not None and ring is not None:
            pair = circle.paper_poses(ring, estimator.grid, estimator.port.ring_radius_m)
            mask = estimator.reflector_network(image)
            yaw_ms, _ = took_ms(yaw.paper_yaw, mask, pair, estimator.port, estimator.grid)
            rows.append((alone_ms, tracked_ms, ransac_ms, yaw_ms))
    return pd.DataFrame(rows[WARM:], columns=list(PARTS))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--save", action="store_true", help="write the committed table")
    save = parser.parse_args().save
    torch.set_num_threads(1)
    tune_allocator()  # as the command does
    recording, rows = open_recording(RECORDING), []
    for precision in sorted({"float32", faster_precision()}, reverse=True):
        for modality in MODALITIES:
            times = times_ms(recording, modality, precision)
            rows += [{"precision": precision, "modality": modality, "part": part, "ms": ms, "hz": 1e3 / ms,
                      "images": len(times)} for part, ms in times.median().items()]  # fmt: skip
    table = pd.DataFrame(rows)
    memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(table.round(1).to_string(), f"\n{processor()}, one core; {memory_mb:.0f} MB at most")
    if save:
        save_table(
            DATA / "results" / "pace.csv", table, processor=processor(), cores=1, memory_mb=round(memory_mb)
        )


if __name__ == "__main__":
    main()
