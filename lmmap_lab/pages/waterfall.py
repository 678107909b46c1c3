"""The ladder from the paper's procedure to ours, drawn: what each change takes away."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from lmmap.settings import MODALITIES, OURS
from lmmap.types import Camera, Port

from ..studies import formula, tolerances
from ..studies.ladder import RUNGS
from .drawings import COLOUR
from .tables import CAMERAS

PANELS = (  # metric, statistic, scale, title
    ("normal_error_deg", "median", 1.0, "normal, median error (°)"),
    ("position_error_m", "median", 1e3, "position, median error (mm)"),
    ("wrong_percent", "in_fov", 1.0, "wrong poses (%)"),
)
STYLES = {"as printed": "o-", "exact circle": "s--", "confident": "^-.", "fused": "d:"}  # by rung
FLOOR = 5e-3  # percent, of the logarithmic axis


def means(rungs: pd.DataFrame, gap: str) -> pd.DataFrame:
    """Means over the lights of a ladder's `PANELS` without outlier filter: rows by rung and modality."""
    cells = rungs[(rungs.training == f"{gap}-domain-gap") & (rungs.outlier_filter == "without")]
    columns = {}
    for metric, statistic, scale, title in PANELS:
        cell = cells[(cells.metric == metric) & (cells.statistic == statistic)]
        columns[title] = scale * cell.groupby(["rung", "modality"]).value.mean()
    return pd.DataFrame(columns).loc[list(RUNGS)]


def readings_deg() -> dict[str, float]:
    """Median error of the normal (deg) by each other reading of the printed formula: without noise, over the
    bench's test poses."""
    camera, port = Camera.davis346(), Port.lm_map()
    T = formula.bench_poses(camera, port)
    medians = formula.medians_by_tilt(T, camera, port.ring_radius_m).loc["all"]
    return medians.drop("printed").to_dict()


def draw_tolerances(table: pd.DataFrame):
    """Figure of wrong poses over the limit of the normal, a line a rung and camera: means over the lights.

    Parameters
    ----------
    table
        `tolerances.table` of one set of networks, by ``light`` and ``modality``.
    """
    shown = table[table.limits == tolerances.ALL]
    shares = shown.groupby(["rung", "modality", "normal_deg"]).wrong_percent.mean()
    fig, ax = plt.subplots(figsize=(5.6, 3.4))
    for rung, style in STYLES.items():
        for m in MODALITIES if rung != "fused" else MODALITIES[:1]:  # one track, which stands in both columns
            line, fused = shares[rung, m], rung == "fused"
            ax.semilogy(line.index, line.clip(lower=FLOOR), style, color=COLOUR["ink" if fused else m], ms=4,
                        label=rung if fused else f"{rung}, {CAMERAS[m]}")  # fmt: skip
    ax.axvline(np.rad2deg(OURS.right_normal_rad), color=COLOUR["ink"], lw=0.8)
    ax.set(xlabel="limit on the error of the normal (°)", ylabel="wrong poses (%)", ylim=(FLOOR, 130))
    ax.set_yticks((0.01, 0.1, 1, 10, 100), ("0.01", "0.1", "1", "10", "100"))
    fig.legend(fontsize=7, ncols=4, loc="outside lower center")
    return fig


def draw(rungs: pd.DataFrame, gap: str = "low", readings: dict[str, float] | None = None,
         only: Mapping[str, str] | None = None, panels=PANELS):  # fmt: skip
    """Draw the ladder of a domain gap as a waterfall: a pair of bars a rung, frames over events.

    A bar's pale end is what the change of that rung, or of those since the one drawn above it, takes away.
    Marks across the first row's normals are other ``readings`` of the formula, by default
    `readings_deg`.  Of the ladder, ``only`` these rungs, by their titles, and ``panels`` are drawn.
    """
    readings = readings_deg() if readings is None else readings
    only = only or dict.fromkeys(RUNGS)
    table, at = means(rungs, gap), np.arange(len(only))
    size = 5.6 if len(panels) == 1 else 7.6, 0.8 + 0.45 * len(only)
    fig, axes = plt.subplots(1, len(panels), figsize=size, sharey=True, squeeze=False)
    axes = axes[0]
    for ax, (*_, title) in zip(axes, panels, strict=True):
        values = table[title].unstack("modality").loc[list(only)]
        for shift, m in ((-0.2, "rgb"), (0.2, "event")):
            now = values[m].to_numpy()
            before = np.r_[now[0], now[:-1]]
            ax.barh(at + shift, np.maximum(before, now), 0.36, color=COLOUR[m], alpha=0.2)
            ax.barh(at + shift, now, 0.36, color=COLOUR[m], label=CAMERAS[m])
            for y, value in zip(at + shift, now, strict=True):
                ax.text(value, y, f" {value:.1f}", va="center", fontsize=8)
        ax.set(xlabel=title, xlim=(0, 1.2 * np.nanmax(values.to_numpy())))
        ax.grid(axis="y", visible=False)
    for name, deg in readings.items():
        axes[0].plot([deg, deg], [-0.5, 0.45], "v-", color=COLOUR["ink"], ms=4, lw=1.2, markevery=2)
        axes[0].annotate(name, (deg, -0.5), (0, 5), textcoords="offset points", rotation=60, fontsize=8)
    axes[0].set_yticks(at, [title or rung for rung, title in only.items()])
    axes[0].invert_yaxis()
    axes[-1].legend(loc="lower right", fontsize=8)
    return fig
