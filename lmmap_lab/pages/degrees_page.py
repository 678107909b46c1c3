"""What made five degrees, drawn: Table I beside predictions, and the ring beneath a drawn pose."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from ..studies.five_degrees_fit import ASKEW, FOUR, LITERAL, NOISE, OUTLYING, Fit, paper_cells
from .drawings import COLOUR
from .port_fit import draw_outline
from .tables import CAMERAS, with_ends

STYLES = {  # of a hypothesis: its words, colour and mark
    NOISE: ("noise alone", "rival", "o"), LITERAL: ("printed formula, any lens", "paper", "s"),
    FOUR: ("best of four roots", "rgb", "D"), ASKEW: ("misaligned truth", "truth", "^"),
}  # fmt: skip
VARIATIONS = {"as it is": "as assumed", "no filter": "no outlier filter", "camera askew": "misaligned camera",
              "noise of masks": "noise of our masks"}  # fmt: skip
SHARES = {"beats_noise": "better than noise alone (%)", "beats_askew": "better than a misaligned truth (%)"}


def draw_cells(fits: Mapping[str, Fit]):
    """Figure of Table I, column by column: medians and root mean squares of the normal, the paper's as
    strokes and the predictions of `STYLES` as marks."""
    paper = paper_cells()
    fig, axes = plt.subplots(2, 1, figsize=(7.6, 4.6), sharex=True)
    at = np.arange(len(paper))
    for ax, statistic, title in zip(axes, range(2), ("median (°)", "root mean square (°)"), strict=True):
        ax.plot(at, paper.to_numpy()[:, statistic], "_", ms=38, mew=2, color=COLOUR["ink"], label="Table I")
        for k, (name, (words, colour, mark)) in enumerate(STYLES.items()):
            predicted = paper.to_numpy()[:, statistic] * np.exp(fits[name].gap[:, statistic])
            ax.plot(at + 0.2 * (k - 1.5), predicted, mark, ms=5, color=COLOUR[colour], label=words)
        ax.set_ylabel(title)
        ax.grid(axis="x", visible=False)
    labels = [f"{light}\n{CAMERAS[camera]}" for _, light, camera in paper.index]
    axes[1].set_xticks(at, labels, fontsize=7)
    first_low = sum(gap == OUTLYING[0] for gap, *_ in paper.index) - 0.5
    for ax in axes:
        ax.axvline(first_low, color=COLOUR["ink"], lw=0.8)
    axes[0].set_title("high-gap networks", loc="left")
    axes[0].set_title("low-gap networks", loc="right")
    fig.legend(
        *axes[0].get_legend_handles_labels(),
        ncols=5,
        fontsize=7.5,
        markerscale=0.6,
        loc="outside lower center",
    )
    return fig


def draw_overlay(outline: Mapping, edges: str):
    """The authors' pixels, the wireframe model through them, and the ring's edges (text of points, px)."""
    fig, ax = plt.subplots(figsize=(5.6, 4.4))
    draw_outline(ax, outline)
    points = np.array([pair.split(",") for pair in edges.split()], float)
    ax.plot(*points.T, ".", color=COLOUR["rgb"], ms=6, label="edges of the ring in the picture")
    ax.legend(loc="lower right", fontsize=8)
    return fig


def misfit_table(study: pd.DataFrame):
    """The study of `five_degrees_study.study`, as it is, in words, styled; best first."""
    rows = study[study.variation == "as it is"].sort_values("misfit")
    table = pd.DataFrame({
        "hypothesis": rows.hypothesis.str.replace("printed", "printed formula"),
        "free": rows.free,
        "misfit": [with_ends(*ends, ".3f") for ends
                   in zip(rows.misfit, rows.misfit_low, rows.misfit_high, strict=True)],
        "ν/Z": [f"{v:.3f}" for v in rows.nu_over_z],
        "misaligned (°)": [f"{v:.1f}" if v else "" for v in rows.misaligned_deg],
        "noise (px)": rows.noise_low_px.map("{:.1f} to ".format) + rows.noise_high_px.map("{:.1f}".format),
    } | {title: [f"{100 * v:.0f}" for v in rows[name]] for name, title in SHARES.items()})  # fmt: skip
    return table.style.hide().set_table_attributes('class="dense"')


def varied_table(study: pd.DataFrame):
    """Misfits of `STYLES` by what was varied, styled."""
    wide = study.pivot(index="variation", columns="hypothesis", values="misfit")
    wide = wide.loc[list(study.variation.unique()), list(STYLES)].rename(
        columns={name: words for name, (words, *_) in STYLES.items()}
    )
    wide.index = wide.index.str.replace("noise lasts", "noise correlation, image to image:").str.replace(
        " x ", " × "
    )
    return wide.rename(index=VARIATIONS).rename_axis(index=None, columns=None).style.format(precision=3)
