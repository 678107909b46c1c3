"""The port's wire model over the lines that its authors drew: outlines only, the pictures are theirs."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection, PolyCollection

from .drawings import COLOUR

MARGIN_PX = 4
DOT_PX = 0.85  # side of a pixel's mark, as the picture enlarged its pixels


def draw_fit(outlines: Mapping[str, dict], titles: Mapping[str, str]):
    """Figure with a drawing for each picture of ``titles``: the authors' pixels and the fitted lines.

    Parameters
    ----------
    outlines
        By picture, as tuning/measure_port.py writes them.
    """
    models = {name: [_points(line) for line in outlines[name]["model"]] for name in titles}
    low = {name: np.concatenate(lines).min(0) - MARGIN_PX for name, lines in models.items()}
    size = np.max([np.concatenate(lines).max(0) + MARGIN_PX - low[name] for name, lines in models.items()], 0)
    fig, axes = plt.subplots(1, len(titles), figsize=(7.6, 7.6 / len(titles) * size[1] / size[0] + 0.4),
                             squeeze=False)  # fmt: skip
    for ax, (name, title) in zip(axes[0], titles.items(), strict=True):
        pixels = np.concatenate([_points(outlines[name][kind]) for kind in ("lines", "windows")])
        ax.add_collection(_squares(pixels))
        ax.add_collection(LineCollection(models[name], colors=COLOUR["event"], lw=0.9))
        (u, v), (width, height) = low[name], size
        ax.set(xlim=(u, u + width), ylim=(v + height, v), xticks=[], yticks=[], aspect="equal", title=title)
        ax.spines[:].set_visible(False)
        ax.set_label("pixels of the authors' lines, and the fitted wire model through them")
    return fig


def _points(text: str) -> np.ndarray:
    return np.array([pair.split(",") for pair in text.split()], float)


def _squares(pixels) -> PolyCollection:
    """Squares in data units, so that pixels look like pixels at each size."""
    corner = DOT_PX / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return PolyCollection(pixels[:, None] + corner, facecolor=COLOUR["truth"], lw=0, alpha=0.55)
