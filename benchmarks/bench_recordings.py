"""Reading AEDAT4 and binning events, each against a named peer in the same run.

    python benchmarks/bench_recordings.py [RECORDING.aedat4]

Ratios are what to look at: both sides of a ratio ran on this machine within the same seconds.
"""

from __future__ import annotations

import sys
import tempfile
import time
import warnings
from pathlib import Path

import dv_processing as dv
import numpy as np

from lmmap.pipeline.histograms import histogram, windows
from lmmap.recordings.formats import open_recording
from lmmap.types import EVENT, Camera, Recording
from lmmap_lab.bench.writers import write_recording

REPEATS = 7


def synthetic(count: int = 2_000_000) -> Recording:
    """Events of a DAVIS 346 at random pixels: the worst case for the cache, the plain one for the rest."""
    rng, camera = np.random.default_rng(0), Camera.davis346()
    events = np.zeros(count, EVENT)
    events["t_us"] = np.sort(rng.integers(0, 2_000_000, count))
    events["x"], events["y"] = rng.integers(0, 346, count), rng.integers(0, 260, count)
    events["p"] = rng.random(count) < 0.5
    return Recording("bench", camera, events, np.zeros((0, 260, 346, 3), np.uint8), np.zeros(0, np.int64))


def best_s(function) -> float:
    """Least wall time of several calls."""
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


def bare_reader(path) -> int:
    """dv-processing alone: batches thrown away, nothing checked."""
    reader = dv.io.MonoCameraRecording(str(path))
    return sum(len(batch.numpy()) for batch in iter(reader.getNextEventBatch, None))


def push_back_each(events, path) -> None:
    """dv-processing's plain way: a loop with one push_back of four arguments an event."""
    store = dv.EventStore()
    for t_us, x, y, p in events.tolist():
        store.push_back(t_us, x, y, p)
    config = dv.io.MonoCameraWriter.Config("bench", dv.CompressionType.ZSTD)
    config.addEventStream((346, 260))
    dv.io.MonoCameraWriter(str(path), config).writeEvents(store)


def all_windows(events, bin_events) -> None:
    for window in windows(events):
        bin_events(events[window])


def add_at(e) -> np.ndarray:
    counts = np.zeros((260, 346), np.uint16)
    np.add.at(counts, (e["y"], e["x"]), 1)
    return counts


def histogram2d(e) -> np.ndarray:
    return np.histogram2d(e["y"], e["x"], (260, 346), ((0, 260), (0, 346)))[0]


def ours(e) -> np.ndarray:
    return histogram(e["x"], e["y"], (346, 260))


def main(path: Path | None, folder: Path) -> None:
    if path is None:
        path = folder / "bench.aedat4"
        write_recording(synthetic(), path)
    recording = open_recording(path)
    events = recording.events
    write_recording(recording, folder / "copy.h5")
    first_window = events[windows(events)[0]]
    np.testing.assert_array_equal(ours(first_window), add_at(first_window))
    np.testing.assert_array_equal(ours(first_window), histogram2d(first_window))
    few = events[:200_000]
    part = Recording("part", recording.camera, few, recording.frames[:0], recording.frames_t_us[:0])

    rows = [
        ("read AEDAT4: lmmap, checked, with frames", len(events), lambda: open_recording(path)),
        ("  peer: dv-processing alone, unchecked", len(events), lambda: bare_reader(path)),
        ("  peer: our HDF5", len(events), lambda: open_recording(folder / "copy.h5")),
        ("write AEDAT4: lmmap", len(few), lambda: write_recording(part, folder / "part.aedat4")),
        (
            "  peer: dv-processing, push_back in a loop",
            len(few),
            lambda: push_back_each(few, folder / "p.aedat4"),
        ),
        ("histogram: lmmap", len(events), lambda: all_windows(events, ours)),
        ("  peer: np.add.at", len(events), lambda: all_windows(events, add_at)),
        ("  peer: np.histogram2d", len(events), lambda: all_windows(events, histogram2d)),
    ]
    print(f"{'stage':44s} {'Mev/s':>8s} {'lmmap is':>9s}")
    for name, count, function in rows:
        seconds = best_s(function)
        rate = count / seconds / 1e6
        if not name.startswith(" "):
            reference = rate
        print(f"{name:44s} {rate:8.1f} {reference / rate:8.1f}x")


if __name__ == "__main__":
    warnings.simplefilter("ignore", UserWarning)  # the nominal camera will do here
    with tempfile.TemporaryDirectory() as temporary:
        main(Path(sys.argv[1]) if len(sys.argv) > 1 else None, Path(temporary))
