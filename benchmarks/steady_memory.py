"""Memory and open files of a process while it estimates one image after another, alone and as a track.

    python benchmarks/steady_memory.py [IMAGES]

The first images load networks and fill caches.  From then to the end memory may grow by 32 MB, and the files
that are open may not become more.  Prints both now and then; ends with 1 if one has grown.
"""

from __future__ import annotations

import os
import resource
import sys
from pathlib import Path

import numpy as np

import lmmap
from lmmap.types import Camera

CAMERA = Camera(160, 120, 324.0, 324.0, 79.5, 59.5)
MOST_MB = 32.0
FIRST = 40  # images


def held() -> tuple[float, int]:
    """Resident memory (MB) and open files."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize() / 2**20, len(os.listdir("/proc/self/fd"))


def main(images: int) -> bool:
    """Whether memory and open files stayed as they were."""
    rng = np.random.default_rng(0)
    frame, event = lmmap.Estimator(CAMERA), lmmap.Estimator(CAMERA, modality="event")
    tracker = lmmap.Tracker(lmmap.Estimator(CAMERA))
    start = None
    for k in range(images):
        image = rng.integers(0, 256, (120, 160, 3), np.uint8)
        frame(image, k)
        tracker(image, 1000 * k)
        event(rng.poisson(0.4, (120, 160)).astype(np.uint16), k)
        if k + 1 == min(FIRST, images - 1):
            start = held()
        if (k + 1) % 250 == 0 or k + 1 == images:
            print(f"{k + 1:6d} images: {held()[0]:7.1f} MB, {held()[1]} open files", flush=True)
    memory_mb, files = held()
    return memory_mb - start[0] < MOST_MB and files <= start[1]


if __name__ == "__main__":
    sys.exit(not main(int(sys.argv[1]) if len(sys.argv) > 1 else 2000))
