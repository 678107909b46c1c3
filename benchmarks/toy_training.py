"""A training of seconds, on made-up images, for those who kill it.

    python benchmarks/toy_training.py FOLDER

Makes what is absent of its training set, goes on from its checkpoint, and writes ``ring.safetensors``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from lmmap_lab.training import dataset, train
from lmmap_lab.training.recipe import Recipe

SHAPE = (100, 104)


def write_samples(folder: Path, rng) -> list[str]:
    """Ten sequences of two small images with a bright square as the ring, its middle as a marker; their
    names."""
    names = [f"augmented-{i}" for i in range(10)]
    for name in names:
        labels = np.zeros((2, *SHAPE), np.uint8)
        row, column = rng.integers(20, 60, 2)
        labels[:, row : row + 12, column : column + 12] = 1
        labels[:, row + 4 : row + 8, column + 4 : column + 8] = 3
        counts = np.where(labels > 0, 7, rng.integers(0, 3, labels.shape))
        events = np.full((2, 3 * counts[0].size), dataset.NO_EVENT, np.uint32)
        for line, image in zip(events, counts, strict=True):
            pixels = rng.permutation(np.repeat(np.arange(image.size), image.ravel()))
            line[: len(pixels)] = pixels
        arrays = dict(rgb=np.repeat(30 * counts[..., None], 3, -1).astype(np.uint8), rgb_labels=labels)
        if not (folder / name).exists():
            dataset.write_samples(folder / name, {**arrays, "event": events, "event_labels": labels}, "toy")
    return names


def main(folder: Path) -> None:
    """Train for forty steps, with a checkpoint every second one."""
    names = write_samples(folder, np.random.default_rng(0))
    recipe = Recipe("ring", "event", steps=40, batch=2, warm_up=1)
    train.train(recipe, folder, weights=folder / "ring.safetensors", names=names, every=2)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    main(Path(sys.argv[1]))
