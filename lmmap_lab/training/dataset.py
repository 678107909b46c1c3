"""The training set on disk: a folder of plain arrays for each sequence, read through memory maps.

An event sample keeps its events sorted by their distance in time from the mask's time.  For any N, the first
N of them are then the histogram of N events around that time.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

import joblib
import numpy as np

from lmmap.files import atomic, read_text, regular_file
from lmmap.pipeline.weights import FILTERS
from lmmap.recordings.stream import input_errors
from lmmap.settings import PAPER
from lmmap.types import Port, Recording

from ..bench import labels, sequences, varied
from ..bench.renderer import ray_grid
from ..provenance import fingerprint
from .augment import each_mask
from .recipe import JOINT

AUGMENTED, REALISTIC, VARIED = 240, 120, 400  # numbers of sequences
MORE_HIGH, PRINTED = 180, 180  # further ones, all in high light: varied, and on printed covers
SEQUENCE_SECONDS, SAMPLES = 0.8, 5
VARIED_SAMPLES = 4  # of a varied sequence, which is shorter
MOST_EVENTS = 2 * PAPER.events_per_window
NO_EVENT = np.uint32(2**32 - 1)  # fills the rows of samples with fewer events
_AUGMENTED = [f"augmented-{i}" for i in range(AUGMENTED)]
_ALL = _AUGMENTED + [f"realistic-{i}" for i in range(REALISTIC)]
_IN_HIGH = [f"varied-{i}" for i in range(VARIED, VARIED + 2 * MORE_HIGH) if varied.light_of(i) == "high"]
SETS = {
    "high": _AUGMENTED, "low": _ALL,
    "robust": [*_ALL, *(f"varied-{i}" for i in range(VARIED)), *_IN_HIGH],
}  # fmt: skip
SETS["slim"] = [*SETS["robust"], *(f"printed-{i}" for i in range(PRINTED))]


def split(names: list[str]) -> tuple[list[str], list[str]]:
    """Training and validation sequences, 80/20: every fifth one validates.

    The cut is by sequence because neighbouring frames of one are nearly equal.
    """
    return [n for i, n in enumerate(names) if i % 5 != 4], names[4::5]


def sample_recording(
    recording: Recording, count: int = SAMPLES, port: Port | None = None
) -> dict[str, np.ndarray]:
    """Images and masks at ``count`` times of a recording whose truth is known.

    Returns
    -------
    dict
        ``rgb`` (N, H, W, 3) u8; ``event`` (N, M) u32: pixel numbers ``y W + x`` by distance in time,
        `NO_EVENT` at the end; ``rgb_labels``, ``event_labels`` (N, H, W) u8: bit k is filter k's mask.
    """
    camera, port = recording.camera, port or Port.lm_map()
    rays, shape = ray_grid(camera, 4), recording.camera.size_px[::-1]

    def masks_at(times_us):
        poses = recording.truth.at(np.asarray(times_us, np.int64))
        masks = [labels.label_masks(pose, port, camera, rays).astype(np.uint8) for pose in poses]
        return np.array([m[0] | m[1] << 1 for m in masks], np.uint8).reshape(-1, *shape)

    chosen = spread(len(recording.frames), count)
    events, middles_us = sample_events(recording, count)
    return {"rgb": recording.frames[chosen], "rgb_labels": masks_at(recording.frames_t_us[chosen]),
            "event": events, "event_labels": masks_at(middles_us)}  # fmt: skip


def sample_events(recording: Recording, count: int) -> tuple[np.ndarray, list[int]]:
    """Pixel numbers (N, M) by distance in time, and the times of the N middles."""
    events, width = recording.events, recording.camera.width_px
    most = min(MOST_EVENTS, len(events))
    rows, middles_us, core = [], [], PAPER.events_per_window
    if most >= core:
        for start in spread(len(events) - most + 1, count):
            piece = events[start : start + most]
            first = (most - core) // 2
            middle_us = (int(piece["t_us"][first]) + int(piece["t_us"][first + core - 1])) // 2
            away_us = np.abs(piece["t_us"] - middle_us)
            reach_us = min(middle_us - piece["t_us"][0], piece["t_us"][-1] - middle_us)
            order = np.argsort(away_us, kind="stable")
            order = order[: max(np.count_nonzero(away_us <= reach_us), core)]
            row = np.full(MOST_EVENTS, NO_EVENT, np.uint32)
            row[: len(order)] = piece["y"][order].astype(np.uint32) * width + piece["x"][order]
            rows.append(row)
            middles_us.append(middle_us)
    return np.array(rows, np.uint32).reshape(-1, MOST_EVENTS), middles_us


def spread(total: int, wanted: int) -> np.ndarray:
    return np.unique(np.linspace(0, total - 1, min(wanted, total)).astype(int))


def write_samples(folder: Path, arrays: dict[str, np.ndarray], made_of: str = "") -> Path:
    """A folder of arrays, whole or not at all."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    with atomic(folder) as temporary:
        temporary.mkdir()
        for name, values in arrays.items():
            np.save(temporary / f"{name}.npy", values)
        (temporary / "made_of").write_text(made_of)
    return folder


def make_sequence_samples(name: str, folder: Path, seconds: float = SEQUENCE_SECONDS,
                          count: int = SAMPLES) -> Path:  # fmt: skip
    """Simulate a sequence and write its samples into ``folder/NAME``, unless they are there."""
    if (folder / name).is_dir():
        return folder / name
    if varied.NAME.fullmatch(name):
        port = varied.draw_port(varied.base_sequence(name))
        samples = sample_recording(varied.record_varied(name, port=port), min(count, VARIED_SAMPLES), port)
        code = (varied.base_sequence, varied.draw_port, varied.record_varied, sample_recording)
        return write_samples(folder / name, samples, fingerprint(code=code))
    recording = sequences.simulate(name, seconds)
    return write_samples(
        folder / name,
        sample_recording(recording, count),
        fingerprint(code=(sequences.simulate, sample_recording)),
    )


def make_samples(
    names: Iterable[str], folder: Path, processes: int | None = None, report=print, **size
) -> None:
    """`make_sequence_samples` of many sequences in parallel, each process with one sequence in memory.

    ``size`` goes to `make_sequence_samples`.  An interrupted run goes on where it was.
    """
    absent = [name for name in names if not (folder / name).is_dir()]
    tasks = [joblib.delayed(make_sequence_samples)(name, folder, **size) for name in absent]
    done = joblib.Parallel(processes or os.cpu_count(), return_as="generator_unordered")(tasks)
    for i, path in enumerate(done):
        report(f"training set: {path.name}, {i + 1} of {len(absent)}")


@lru_cache(maxsize=256)  # opening costs more than reading; each open map holds a file descriptor
def _memory_map(path: Path) -> np.ndarray:
    with input_errors(path, "damaged samples", "delete their folder, which is then made anew"):
        return np.load(regular_file(path), mmap_mode="r")


class Samples:
    """The samples of several sequences for one filter or both; arrays stay on disk until one is asked for.

    Parameters
    ----------
    names : sequences; some may have no sample of this modality
    filter_name, modality : one of `FILTERS` or `recipe.JOINT`; ``"rgb"`` or ``"event"``
    folder : where `make_samples` wrote
    """

    def __init__(self, names: list[str], filter_name: str, modality: str, folder: Path):
        self.names, self.modality, self.folder = list(names), modality, folder
        self._bits = sum(1 << k for k, name in enumerate(FILTERS) if filter_name in (name, JOINT))
        self._places = [(n, i) for n in self.names for i in range(len(self._array(n, "_labels")))]

    def _array(self, name: str, suffix: str = "") -> np.ndarray:
        return _memory_map(self.folder / name / f"{self.modality}{suffix}.npy")

    def __len__(self) -> int:
        return len(self._places)

    def mask(self, index: int) -> np.ndarray:
        """Mask (H, W) of one filter, bool; of both, u8 with a bit for each."""
        name, i = self._places[index]
        mask = np.asarray(self._array(name, "_labels")[i]) & self._bits
        return mask > 0 if self._bits in (1, 2) else mask

    def image(self, index: int, events: int = PAPER.events_per_window) -> np.ndarray:
        """Frame (H, W, 3) u8, or histogram (H, W) u16 of the ``events`` events nearest the mask's time."""
        name, i = self._places[index]
        data = self._array(name)[i]
        if self.modality == "rgb":
            return np.asarray(data)
        height, width = self._array(name, "_labels").shape[1:]
        pixels = np.asarray(data[:events])
        counts = np.bincount(pixels[pixels != NO_EVENT], minlength=height * width)
        return counts.reshape(height, width).astype(np.uint16)

    def positive_share(self):
        """Share of pixels in the masks: the class prior; of both filters, (2,)."""
        some = range(0, len(self), max(len(self) // 100, 1))
        return np.mean([each_mask(self.mask(i)).mean((-2, -1)) for i in some], 0).squeeze()[()]

    def made_of(self) -> str:
        """Fingerprints of what made the samples: the bench, the varied laboratories, or ``recordings``."""
        return " ".join(sorted({read_text(self.folder / n / "made_of", 2**12)[:12] for n in self.names}))
