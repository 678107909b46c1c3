"""Samples for spiking networks: windows of events in the order in which they came, and their slices."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import joblib
import numpy as np
import torch

from lmmap.pipeline.histograms import middle_us
from lmmap.settings import PAPER
from lmmap.types import Port, Recording

from ..bench import labels, sequences
from ..bench.renderer import ray_grid
from ..provenance import fingerprint
from . import dataset
from .spiking import sliced

SETUP = sequences.Setup(frame_hz=0.25)  # events alone are used, and frames take most of the time


def sample_windows(recording: Recording, count: int, port: Port) -> dict[str, np.ndarray]:
    """Evenly spread windows of N events of a recording whose truth is known.

    Returns
    -------
    dict
        ``event`` (K, N) u32: pixel numbers ``y W + x`` in the order of time; ``event_t_us`` (K, N) i64;
        ``event_labels`` (K, H, W) u8: bit k is filter k's mask in the middle of the window.
    """
    events, camera, size = recording.events, recording.camera, PAPER.events_per_window
    starts = np.unique(np.linspace(0, len(events) - size, count).astype(int)) if len(events) >= size else []
    windows, rays = [events[start : start + size] for start in starts], ray_grid(camera, 4)
    masks = [
        labels.label_masks(recording.truth.at(np.array([middle_us(w)]))[0], port, camera, rays)
        for w in windows
    ]
    numbers = [w["y"].astype(np.uint32) * camera.width_px + w["x"] for w in windows]
    return {
        "event": np.array(numbers, np.uint32).reshape(-1, size),
        "event_t_us": np.array([w["t_us"] for w in windows], np.int64).reshape(-1, size),
        "event_labels": np.array([m[0] | m[1] << 1 for m in masks], np.uint8)
        .reshape(-1, *camera.size_px[::-1]),
    }  # fmt: skip


def make_windows(names: Iterable[str], folder: Path, count: int, jobs: int, report=print) -> None:
    """Simulate sequences and write their windows into ``folder/NAME``; those that are there are kept."""
    absent = [name for name in names if not (folder / name).is_dir()]
    tasks = [joblib.delayed(_make)(name, folder, count) for name in absent]
    for i, path in enumerate(joblib.Parallel(jobs, return_as="generator_unordered")(tasks), 1):
        report(f"windows: {path.name}, {i} of {len(absent)}")


def _make(name: str, folder: Path, count: int) -> Path:
    recording = sequences.simulate(name, dataset.SEQUENCE_SECONDS, setup=SETUP)
    windows = sample_windows(recording, count, Port.lm_map())
    return dataset.write_samples(
        folder / name, windows, fingerprint(code=(sequences.simulate, sample_windows))
    )


class SliceSamples(dataset.Samples):
    """Samples as `make_windows` writes them, of images (H, W, T): each slice's input, as `spiking.sliced`.

    Parameters
    ----------
    slices : T
    """

    def __init__(self, names: list[str], filter_name: str, modality: str, folder: Path, slices: int):
        super().__init__(names, filter_name, modality, folder)
        self.slices = slices

    def image(self, index: int, events: int = PAPER.events_per_window) -> np.ndarray:
        """Input (H, W, T) of the first ``events`` events."""
        name, i = self._places[index]
        shape = self._array(name, "_labels").shape[1:]
        return np.moveaxis(sliced(self._array(name)[i][:events], shape, self.slices), 0, -1)


def encode_slices(images: np.ndarray, modality: str = "event") -> torch.Tensor:
    """A network's input (T N, 1, H, W) of images (N, H, W, T), as `network.encode`."""
    slices = np.moveaxis(images, -1, 0).reshape(-1, 1, *images.shape[1:3])
    return torch.from_numpy(np.ascontiguousarray(slices))
