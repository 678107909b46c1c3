"""Figure of the chapter on other runtimes: how long each takes from an image to a pose."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from .drawings import COLOUR
from .tables import CAMERAS

CORES, RUNTIMES = {1: "one core", 2: "two cores"}, {"torch": "PyTorch", "ONNX Runtime": "ONNX Runtime"}


def draw(times: pd.DataFrame):
    """Bars of ``data/results/onnxruntime.csv``, a panel for each camera; the networks' part is dark."""
    fig, axes = plt.subplots(1, 2, figsize=(7.6, 3.5), sharex=True, sharey=True)
    for ax, (modality, rows) in zip(axes, times.groupby("modality", sort=False), strict=True):
        names = rows.runtime.map(RUNTIMES) + ", " + rows.precision + "\n" + rows.cores.map(CORES)
        at = np.arange(len(rows))
        ax.barh(at, rows.pose_ms, 0.7, color=COLOUR[modality], alpha=0.3, label="the rest")
        ax.barh(at, rows.networks_ms, 0.7, color=COLOUR[modality], label="networks")
        for y, value in zip(at, rows.pose_ms, strict=True):
            ax.text(value, y, f" {value:.0f}", va="center", fontsize=8)
        ax.set(
            xlabel="median time of an image (ms)",
            title=CAMERAS[modality],
            xlim=(0, 1.2 * times.pose_ms.max()),
        )
        ax.set_yticks(at, names, fontsize=8)
        ax.grid(axis="y", visible=False)
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.22), ncols=2, fontsize=8)
    axes[0].invert_yaxis()
    return fig
