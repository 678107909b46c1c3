"""The port's wireframe model over the lines that its authors drew: outlines only, the pictures are theirs."""

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
        By picture, those of data/results/port-outlines.json.
    """
    fig, axes = plt.subplots(1, len(titles), figsize=(7.6, 4.2), squeeze=False)
    for ax, (name, title) in zip(axes[0], titles.items(), strict=True):
        draw_outline(ax, outlines[name])
        ax.set_title(title)
    return fig


def draw_outline(ax, outline: Mapping) -> None:
    """The authors' pixels in one picture, and the fitted lines."""
    model = [_points(line) for line in outline["model"]]
    ax.add_collection(_squares(np.concatenate([_points(outline[kind]) for kind in ("lines", "windows")])))
    ax.add_collection(LineCollection(model, colors=COLOUR["event"], lw=0.9))
    (left, top), (right, bottom) = (f(np.concatenate(model), 0) for f in (np.min, np.max))
    ax.set(xlim=(left - MARGIN_PX, right + MARGIN_PX), ylim=(bottom + MARGIN_PX, top - MARGIN_PX))
    ax.set(xticks=[], yticks=[], aspect="equal")
    ax.spines[:].set_visible(False)
    ax.set_label("pixels of the authors' lines, and the fitted wireframe model through them")


def _points(text: str) -> np.ndarray:
    return np.array([pair.split(",") for pair in text.split()], float)


def _squares(pixels) -> PolyCollection:
    """Squares in data units, so that pixels look like pixels at each size."""
    corner = DOT_PX / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return PolyCollection(pixels[:, None] + corner, facecolor=COLOUR["truth"], lw=0, alpha=0.55)
