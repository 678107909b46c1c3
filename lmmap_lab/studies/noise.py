"""How noisy an event sensor must be for slow motion to hide the port, as it did in the paper's recording.

    python -m lmmap_lab.studies.noise [RECORDING OF A DAVIS 346]

Noise fills a histogram of N events before a slow port has moved.  The study records ``hard-slow`` with event
sensors that differ in nothing but their shot noise, and counts the images with an ellipse.  Real recordings
are measured alike (`background_hz`), and show where a real sensor stands.  Nothing is chosen by it.  The
table is kept in data/results/slow-motion.csv; without a recording its measured rows stay as they are.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from lmmap.estimation.estimates import estimate_images
from lmmap.estimation.images import timed_images
from lmmap.evaluation.error_table import errors, is_wrong
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.histograms import histogram
from lmmap.recordings.formats import open_recording
from lmmap.settings import PAPER
from lmmap.types import AnyRecording, Port, Recording

from ..bench import sequences
from ..bench.event_sensor import SensorSettings
from ..provenance import DATA, save_table
from .right_and_wrong import shares

COMMITTED = DATA / "results" / "slow-motion.csv"
SHOT_HZ = (0.0, 0.1, 0.2, SensorSettings().shot_hz, 1.0, 2.0, 4.0, 8.0)
SECONDS = 15.0
BLOCK_PX = 10
STILL_PERCENT = 25  # of the blocks have so few events that nothing moved in them
HOT = 10.0  # a pixel is hot that has as many times the events of its block's mean, and one more


def event_counts(recording: AnyRecording) -> tuple[np.ndarray, float]:
    """Events of each pixel (H, W), and the seconds from the first event to the last."""
    counts, ends_us = np.zeros(recording.camera.size_px[::-1]), []
    for events in recording.chunks():
        counts += histogram(events["x"], events["y"], recording.camera.size_px)
        ends_us += [int(events["t_us"][0]), int(events["t_us"][-1])]
    return counts, (ends_us[-1] - ends_us[0]) * 1e-6


def background_hz(counts: np.ndarray, seconds: float) -> float:
    """Events a second of a pixel in the still parts of an image (H, W) of `event_counts`, without hot pixels.

    The image is cut into blocks of 10 x 10 pixels; the lower quartile of their rates is taken.
    """
    height, width = counts.shape
    rows, columns = height // BLOCK_PX, width // BLOCK_PX
    blocks = counts[: rows * BLOCK_PX, : columns * BLOCK_PX].reshape(rows, BLOCK_PX, columns, BLOCK_PX)
    blocks = blocks.transpose(0, 2, 1, 3).reshape(rows * columns, -1)
    hot = blocks > HOT * blocks.mean(1, keepdims=True) + 1
    rates_hz = np.ma.array(blocks, mask=hot).mean(1).filled(np.nan) / seconds
    return float(np.nanpercentile(rates_hz, STILL_PERCENT))


def success(recording: Recording, estimator: Estimator) -> dict[str, float]:
    """Shares of a recording's histograms: with an ellipse, with a right, a wrong and no pose, in percent."""
    timed = timed_images(recording, "event", estimator.settings, PAPER.rate_hz)
    estimates = [estimate for _, estimate in estimate_images(timed, estimator)]
    table = errors(recording, estimates, Port.lm_map())
    answers = shares(table.position_error_m.notna().to_numpy(), is_wrong(table))
    return {"ellipse_percent": 100 * np.mean([e.ellipse is not None for e in estimates]), **answers}


def crossing(x, y, level: float) -> float:
    """Where a curve through ``x, y`` (N,), ``x`` rising, first falls to a level; NaN if it never does."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    below = np.flatnonzero(y <= level)
    if not len(below) or below[0] == 0:
        return np.nan
    k = below[0]
    share = (y[k - 1] - level) / (y[k - 1] - y[k])
    return float(x[k - 1] + share * (x[k] - x[k - 1]))


def of_the_bench(report=print) -> pd.DataFrame:
    """A row for each rate of `SHOT_HZ`: the noise of still pixels, and `success`."""
    rows, estimator = [], Estimator(modality="event")
    for shot_hz in SHOT_HZ:
        sensor = replace(SensorSettings(), shot_hz=shot_hz)
        recording = sequences.simulate("hard-slow", SECONDS, sensor=sensor)
        noise_hz = background_hz(*event_counts(recording))
        rows.append({"source": "bench", "shot_hz": shot_hz, "background_hz": noise_hz,
                     "seconds": SECONDS, **success(recording, estimator)})  # fmt: skip
        report(
            "shot noise {shot_hz:g} Hz: {background_hz:.3f} Hz, ellipse {ellipse_percent:.0f} %".format(
                **rows[-1]
            )
        )
    return pd.DataFrame(rows)


def of_recording(path: Path) -> pd.DataFrame:
    """One row with the noise of a real recording."""
    counts, seconds = event_counts(open_recording(path))
    row = {"source": path.name, "background_hz": background_hz(counts, seconds), "seconds": seconds}
    return pd.DataFrame([row])


def main(paths: Sequence[str]) -> None:
    kept = pd.read_csv(COMMITTED).query("source != 'bench'") if COMMITTED.exists() else pd.DataFrame()
    measured = [of_recording(Path(path)) for path in paths] or [kept]
    table = pd.concat([of_the_bench(), *measured], ignore_index=True)
    print(table.to_string())
    save_table(COMMITTED, table, sequence="hard-slow", seconds=SECONDS)


if __name__ == "__main__":
    main(sys.argv[1:])
