"""The ladder from the paper's procedure to ours, drawn: what each change takes away."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from ..studies.ladder import RUNGS
from .drawings import COLOUR
from .tables import CAMERAS

PANELS = (  # metric, statistic, scale, title
    ("normal_error_deg", "median", 1.0, "normal, median error (°)"),
    ("position_error_m", "median", 1e3, "position, median error (mm)"),
    ("wrong_percent", "in_fov", 1.0, "wrong poses (%)"),
)


def means(rungs: pd.DataFrame, gap: str) -> pd.DataFrame:
    """Means over the lights of a ladder's `PANELS` without outlier filter: rows by rung and modality."""
    cells = rungs[(rungs.training == f"{gap}-domain-gap") & (rungs.outlier_filter == "without")]
    columns = {}
    for metric, statistic, scale, title in PANELS:
        cell = cells[(cells.metric == metric) & (cells.statistic == statistic)]
        columns[title] = scale * cell.groupby(["rung", "modality"]).value.mean()
    return pd.DataFrame(columns).loc[list(RUNGS)]


def draw(rungs: pd.DataFrame, gap: str = "low"):
    """Draw the ladder of a domain gap as a waterfall: a pair of bars a rung, frames over events.

    A bar's pale end is what the change of that rung takes away.
    """
    table, at = means(rungs, gap), np.arange(len(RUNGS))
    fig, axes = plt.subplots(1, len(PANELS), figsize=(7.6, 4.4), sharey=True)
    for ax, title in zip(axes, table, strict=True):
        values = table[title].unstack("modality").loc[list(RUNGS)]
        for shift, m in ((-0.2, "rgb"), (0.2, "event")):
            now = values[m].to_numpy()
            before = np.r_[now[0], now[:-1]]
            ax.barh(at + shift, np.maximum(before, now), 0.36, color=COLOUR[m], alpha=0.2)
            ax.barh(at + shift, now, 0.36, color=COLOUR[m], label=CAMERAS[m])
            for y, value in zip(at + shift, now, strict=True):
                ax.text(value, y, f" {value:.1f}", va="center", fontsize=7)
        ax.set(xlabel=title, xlim=(0, 1.2 * np.nanmax(values.to_numpy())))
        ax.grid(axis="y", visible=False)
    axes[0].set_yticks(at, list(RUNGS))
    axes[0].invert_yaxis()
    axes[-1].legend(loc="lower right")
    return fig
