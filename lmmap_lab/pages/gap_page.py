"""Figures of errors across the domain gap, and of what covariances promise, from the study's tables."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from scipy.stats import chi2

from ..studies.table1 import LIGHTS
from .drawings import COLOUR, draw_intervals
from .tables import CAMERAS
from .tables import LIGHTS as TITLES

PANELS = (  # metric, statistic, scale, label
    ("position_error_m", "median", 1e3, "position error (mm)"),
    ("detection_rate_percent", "in_fov", 1.0, "found, ring in view (%)"),
)
SHIFTS = {"rgb": -0.15, "event": 0.15}  # of a camera's marks, beside a light
PROMISES = (("position_m", "mm", 1e3), ("normal_deg", "°", 1.0))  # what, unit, scale


def draw_gap(high: pd.DataFrame, low: pd.DataFrame):
    """Figure of errors and detection rates over the lights: the high gap on the left, the low on the right.

    Parameters
    ----------
    high, low
        Rows of `table1.compare` of a domain gap and of one choice of outlier filter.
    """
    fig, axes = plt.subplots(len(PANELS), 2, figsize=(7.5, 4.8), sharex=True)
    for row, (metric, statistic, scale, label) in enumerate(PANELS):
        for ax, gap in zip(axes[row], (high, low), strict=True):
            _draw_beside_paper(ax, gap[(gap.metric == metric) & (gap.statistic == statistic)], scale)
        axes[row, 0].set_ylabel(label)
    for column, title in enumerate(("high domain gap", "low domain gap")):
        axes[0, column].set(title=title, yscale="log")
        axes[1, column].set_xticks(range(len(LIGHTS)), TITLES.values())
    axes[0, 1].legend(fontsize=8)
    return fig


def _draw_beside_paper(ax, cells: pd.DataFrame, scale: float) -> None:
    """Our values with their intervals, and the paper's, over the lights."""
    x = np.arange(len(LIGHTS))
    for m, shift in SHIFTS.items():
        cell = cells[cells.modality == m].set_index("light").loc[list(LIGHTS)]
        values = scale * cell[["ours", "ours_low", "ours_high", "table1"]]
        draw_intervals(ax, x + shift, values.ours, values.ours_low, values.ours_high, COLOUR[m],
                       f"{CAMERAS[m]}, ours")  # fmt: skip
        ax.plot(x + shift, values.table1, "D", ms=5, color=COLOUR["paper"],
                label="paper" if m == "rgb" else None)  # fmt: skip


def draw_gap_cost(rate_percent: pd.DataFrame, cost: pd.DataFrame):
    """Figure of what a high gap costs: shares of images with a pose, and the factor by which errors grow.

    Parameters
    ----------
    rate_percent
        Shares of images with a pose: rows by light and modality, a column for each gap.
    cost
        ``error grows by``, rows as of ``rate_percent``.
    """
    fig, (left, right) = plt.subplots(1, 2, figsize=(7.6, 3.2), width_ratios=(1.4, 1))
    for (light, m), rates in rate_percent.iterrows():
        x, colour = list(LIGHTS).index(light) + SHIFTS[m], COLOUR[m]
        low, high = rates["low-domain-gap"], rates["high-domain-gap"]
        left.plot([x, x], [low, high], color=colour, lw=2, label=CAMERAS[m] if light == LIGHTS[0] else None)
        left.plot(x, low, "o", color=colour)
        left.plot(x, high, "o", color=colour, mfc="white")
        right.plot(x, cost.loc[(light, m), "error grows by"], "o", color=colour)
    for ax in (left, right):
        ax.set_xticks(range(len(LIGHTS)), TITLES.values())
    left.set(ylabel="images with a pose (%)", ylim=(None, 101))
    left.legend(loc="lower left")
    right.axhline(1, color=COLOUR["ink"], lw=0.8)
    right.set(ylabel="median error, high over low gap", ylim=(0.9, None))
    return fig


def draw_promise(promise: pd.DataFrame):
    """Figure of errors over predicted standard deviations, with the lines on which half and 95 % should lie.

    Parameters
    ----------
    promise
        The study's table of that name: ``what, modality, predicted, error, most``, a row for each tenth.
    """
    fig, axes = plt.subplots(1, len(PROMISES), figsize=(7, 3))
    for ax, (what, unit, scale) in zip(axes, PROMISES, strict=True):
        for m, title in CAMERAS.items():
            tenths = promise[(promise.what == what) & (promise.modality == m)]
            ax.loglog(scale * tenths.predicted, scale * tenths.error, "o", ms=3, color=COLOUR[m], label=title)
            ax.loglog(scale * tenths.predicted, scale * tenths.most, "^", ms=3, color=COLOUR[m], mfc="none")
        for share in (0.5, 0.95):
            ends = np.array(ax.get_xlim())
            ax.plot(ends, ends * np.sqrt(chi2.ppf(share, 1)), color=COLOUR["ink"], lw=1)
        ax.set(xlabel=f"predicted ({unit})", ylabel=f"error ({unit})", title=what.split("_")[0])
    axes[0].legend(fontsize=8)
    return fig
