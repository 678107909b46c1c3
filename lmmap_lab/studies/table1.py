"""The paper's Table I and ours beside it: cells with their intervals, and the saturation of the images."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from lmmap.evaluation import cells
from lmmap.settings import MODALITIES, PAPER
from lmmap.types import Port, Recording

from ..bench import labels, photometry, sequences
from ..provenance import DATA
from . import bootstrap

LIGHTS, DOMAIN_GAPS = ("low", "medium", "high"), ("low", "high")
TRACKS = (*MODALITIES, "fused")  # the estimates that are judged
COMPARED = {"as printed": "as_printed", "printed": "printed", "exact": "ours", "certain": "certain",
            "fused": "fused"}  # fmt: skip
BLOCK_S = 5.0  # of the bootstrap: a quarter of the test motion's mean period, after which the view is another
RESAMPLED = {  # the cells' statistics, of values (N,) that are each taken `counts` (draws, N) times
    cells.median: bootstrap.medians, cells.root_mean_square: bootstrap.root_mean_squares,
    cells.percent: lambda flags, counts: 100 * bootstrap.shares(flags == 1, np.isfinite(flags), counts),
}  # fmt: skip


def summary(
    tables: pd.DataFrame | Sequence[pd.DataFrame],
    draws: int = 0,
    seed: int = 0,
    rate_hz: float = PAPER.rate_hz,
    variants: Mapping[str, tuple] = cells.VARIANTS,
) -> pd.DataFrame:
    """`cells.summary` of sequences, and the 95 % intervals of its values.

    Parameters
    ----------
    tables
        `error_table.errors` of one sequence, or of several that count as one.
    draws
        Draws of the bootstrap; with 0 the intervals are NaN.
    rate_hz
        The estimates' rate.

    Returns
    -------
    DataFrame
        ``outlier_filter, metric, variant, statistic, value``, and the interval's ends ``low, high``.
    """
    tables = [tables] if isinstance(tables, pd.DataFrame) else list(tables)
    table = pd.concat(tables, ignore_index=True)
    counts = bootstrap_counts([len(t) for t in tables], draws, seed, rate_hz)
    samples = [RESAMPLED[cell.function](cell.values, counts) for cell in cells.cells(table, variants)]
    low, high = zip(*map(bootstrap.interval, samples), strict=True)
    return cells.summary(table, variants).assign(low=low, high=high)


def bootstrap_counts(
    lengths: Sequence[int], draws: int, seed: int, rate_hz: float = PAPER.rate_hz
) -> np.ndarray:
    """`bootstrap.block_counts` with blocks of `BLOCK_S`, for sequences of ``lengths`` images at a rate."""
    return bootstrap.block_counts(lengths, round(BLOCK_S * rate_hz), draws, np.random.default_rng(seed))


def saturation(recording: Recording, port: Port, rate_hz: float = PAPER.rate_hz) -> pd.DataFrame:
    """Percent of the port's region of interest that is black and white, in frames at a rate.

    Returns
    -------
    DataFrame
        ``t_us, low, high``: the time, the share of black pixels, the share of white pixels.
    """
    rows, every = [], max(round(sequences.FRAME_HZ / rate_hz), 1)
    times_us = recording.frames_t_us[::every]
    frames = zip(times_us.tolist(), recording.truth.at(times_us), recording.frames[::every], strict=True)
    for t_us, pose, frame in frames:
        region = labels.label_masks(pose, port, recording.camera).any(0)
        if region.any():
            rows.append((t_us, *photometry.roi_saturation_percent(frame, region)))
    return pd.DataFrame(rows, columns=["t_us", "low", "high"])


def compare(folder: Path) -> pd.DataFrame:
    """The paper's Table I and our ``summary.csv`` of a folder, cell by cell.

    Returns
    -------
    DataFrame
        A row per cell of the paper's table, and of the share of wrong poses, which the paper does not state.
        ``table1``: the paper's value; ``as_printed``: that of its whole procedure on our bench; ``printed``:
        that of its formula on our ellipses; ``ours``: that of the exact and refined pose; ``certain``: the
        same where the covariance is small; ``fused``: that of both modalities together, equal for both.  All
        but the first have their 95 % interval in columns with ``_low`` and ``_high`` appended.
    """
    cell = ["training", "outlier_filter", "metric", "statistic", "light"]
    compared = pd.read_csv(DATA / "paper" / "table1.csv").rename(columns={"value": "table1"})
    rates = compared[(compared.metric == "detection_rate_percent") & (compared.statistic == "in_fov")]
    compared = pd.concat([compared, rates.assign(metric="wrong_percent", table1=np.nan)], ignore_index=True)
    summaries = pd.read_csv(folder / "summary.csv")
    if (folder / "ladder.csv").exists():
        rungs = pd.read_csv(folder / "ladder.csv").rename(columns={"rung": "variant"})
        summaries = pd.concat([summaries, rungs[rungs.variant == "as printed"]])
    for variant, name in COMPARED.items():
        ends = {"value": name, "low": f"{name}_low", "high": f"{name}_high"}
        cells = summaries[summaries.variant == variant].rename(columns=ends)
        how = "inner" if variant in ("printed", "exact") else "left"  # the others are not in every study
        keys = cell if variant == "fused" else [*cell, "modality"]
        compared = compared.merge(cells[[*keys, *ends.values()]], on=keys, how=how)
    return compared
