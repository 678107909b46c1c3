"""Figures of errors across the domain gap, and of what covariances promise, from the study's tables."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from scipy.stats import chi2

from lmmap.pipeline.weights import SETS

from ..studies import domain_gap
from ..studies.table1 import LIGHTS
from .drawings import COLOUR, draw_intervals, plain_log
from .tables import CAMERAS, with_ends

MEASURES = {  # of `domain_gap`: title, scale
    "mask_overlap": ("overlap of the masks", 1), "ring_right": ("right rings (%)", 100),
    "pose_right": ("right poses (%)", 100),
}  # fmt: skip
SHIFTS = {"rgb": -0.15, "event": 0.15}  # of a camera's marks, beside a light
PROMISES = (("position_m", "mm", 1e3), ("normal_deg", "°", 1.0))  # what, unit, scale


def draw_costs(table: pd.DataFrame, place: str = "film"):
    """Figure of what a domain gap costs, one panel a measure: dots with intervals, and crosses by seed.

    Parameters
    ----------
    table : `domain_gap.table`
    """
    fig, axes = plt.subplots(1, len(MEASURES), figsize=(7.6, 2.9))
    costs = table[(table.place == place) & (table.quantity == "cost of the gap")]
    lights = [*LIGHTS, domain_gap.ALL_LIGHTS]
    for ax, (measure, (title, scale)) in zip(axes, MEASURES.items(), strict=True):
        for m, shift in SHIFTS.items():
            cells = costs[(costs.measure == measure) & (costs.modality == m)].set_index("light").loc[lights]
            at, seeds = np.arange(len(lights)) + shift, cells.filter(like="seed_")
            for seed in seeds:
                ax.plot(at + 0.11, scale * seeds[seed], "x", ms=4, mew=1.2, color=COLOUR[m])
            ends = scale * cells[["value", "low", "high"]]
            draw_intervals(ax, at, ends.value, ends.low, ends.high, COLOUR[m], CAMERAS[m])
        ax.axhline(0, color=COLOUR["ink"], lw=0.8)
        ax.set_xticks(range(len(lights)), lights)
        ax.set(title=title, xlabel="light")
    axes[0].set_ylabel("low gap minus high gap")
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return fig


def draw_sets(table: pd.DataFrame, place: str):
    """Figure of each set of networks in a place, over all lights: one panel a measure, with intervals.

    Parameters
    ----------
    table : `domain_gap.table`
    """
    fig, axes = plt.subplots(1, len(MEASURES), figsize=(7.6, 2.9))
    shown = table[(table.place == place) & (table.light == domain_gap.ALL_LIGHTS)]
    sets = [name for name in SETS if name in set(shown.quantity)]
    for ax, (measure, (title, scale)) in zip(axes, MEASURES.items(), strict=True):
        for m, shift in SHIFTS.items():
            cells = shown[(shown.measure == measure) & (shown.modality == m)]
            ends = scale * cells.set_index("quantity").loc[sets, ["value", "low", "high"]]
            draw_intervals(ax, np.arange(len(ends)) + shift, ends.value, ends.low, ends.high, COLOUR[m],
                           CAMERAS[m])  # fmt: skip
        ax.set_xticks(range(len(sets)), sets)
        ax.set(title=title, xlabel="set of networks", ylim=(0, None))
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return fig


def cost_table(table: pd.DataFrame, place: str = "film") -> pd.DataFrame:
    """What the gap costs frames and events and how much less events, with 95 % intervals in brackets: a row a
    measure and light."""
    columns = {**{m: CAMERAS[m] for m in domain_gap.CAMERAS}, domain_gap.EITHER: "frames minus events"}
    rows = {}
    for measure, (title, scale) in MEASURES.items():
        digits = 2 if scale == 1 else 0
        for light in (*LIGHTS, domain_gap.ALL_LIGHTS):
            cells = [domain_gap.cell(table, place, measure, light, m, "cost of the gap") for m in columns]
            rows[title, light] = [in_words(cell, scale, digits) for cell in cells]
    return pd.DataFrame(rows, index=columns.values()).T


def in_words(cell: pd.Series, scale: float = 1.0, digits: int = 2) -> str:
    """A cell of `domain_gap.table` with its interval: "0.10 (0.05 to 0.15)"."""
    return with_ends(*(scale * cell[end] for end in ("value", "low", "high")), f".{digits}f")


def lights_in_words(table: pd.DataFrame, place: str, measure: str) -> str:
    """In which lights the gap costs events less than frames, as a sentence."""
    cells = {light: domain_gap.cell(table, place, measure, light, domain_gap.EITHER, "cost of the gap")
             for light in LIGHTS}  # fmt: skip
    kinds = {
        "events lose less than frames in {} light": [k for k, c in cells.items() if c["low"] > 0],
        "they lose more in {} light": [k for k, c in cells.items() if c["high"] < 0],
        "in {} light the difference may be due to chance": [
            k for k, c in cells.items() if c["low"] <= 0 <= c["high"]
        ],
    }
    return "; ".join(words.format(" and ".join(lights)) for words, lights in kinds.items() if lights)


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
        for axis in (ax.xaxis, ax.yaxis):  # 0.3, not 3 x 10^-1
            plain_log(axis, (1, 3))
    axes[0].legend(fontsize=8)
    return fig
