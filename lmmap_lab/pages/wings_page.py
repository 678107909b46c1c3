"""The package as a figure: its modules in their wings, and a line for each import."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt

from .drawings import COLOUR

MOST = 7  # modules side by side; a wing of more has several lines


def draw_wings(wings: Mapping[str, Sequence[str]], imports: Sequence[tuple[str, str]]):
    """Figure of the wings, the highest above, and of the imports between their modules.

    Parameters
    ----------
    wings
        Modules by the wing's title.
    imports
        Pairs of modules, of which the first imports the second.
    """
    places, heights, y = {}, {}, 0.0
    for title, modules in wings.items():
        lines = -(-len(modules) // MOST)
        for k in range(lines):
            line = modules[k::lines]
            places |= {module: ((n + 0.5) / len(line), y - k) for n, module in enumerate(line)}
        heights[title], y = y - (lines - 1) / 2, y - lines - 0.6
    fig, ax = plt.subplots(figsize=(7.6, 8.4))
    for pair in imports:
        x_pair, y_pair = zip(*(places[module] for module in pair), strict=True)
        ax.plot(x_pair, y_pair, color=COLOUR["ink"], lw=0.5, alpha=0.25, zorder=0)
    box = {"boxstyle": "round", "fc": COLOUR["rgb"], "ec": "none"}
    for module, place in places.items():
        ax.text(*place, module.split(".")[-1], ha="center", va="center", color="white", bbox=box, fontsize=6)
    for title, height in heights.items():
        ax.text(-0.02, height, title, ha="right", va="center", fontsize=8, color=COLOUR["ink"])
    ax.set(xlim=(-0.12, 1), ylim=(y, 1))
    ax.set_label("the modules in their wings, and a line for each import")
    ax.set_axis_off()
    return fig
