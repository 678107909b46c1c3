"""Drawings of the chapter on odometry."""

from __future__ import annotations

import numpy as np

from .drawings import COLOUR
from .tables import CAMERAS

METHOD_COLOUR = {"EVO event": "#777777", "ORB-SLAM3 event": COLOUR["rival"], "ORB-SLAM3 rgb": "#6A4C93",
                 "lmmap event": COLOUR["event"], "lmmap rgb": COLOUR["rgb"], "SVO event": COLOUR["paper"],
                 "SVO rgb": "#009E73"}  # fmt: skip


def in_words(name: str) -> str:
    """A key of `METHOD_COLOUR` as legends have it: "SVO, frames"."""
    method, modality = name.rsplit(" ", 1)
    return f"{method}, {CAMERAS[modality]}"


def draw_boxes(ax, groups: dict[str, list[np.ndarray]], ticks: list[str]) -> None:
    """Box plots side by side over shared ticks: ``groups[method][k]`` are the values at tick k.

    Boxes hold the middle half; whiskers reach to the last value within one and a half box lengths.
    """
    width = 0.8 / max(len(groups), 1)
    for row, (name, values) in enumerate(groups.items()):
        ink = {"color": METHOD_COLOUR[name]}
        boxes = [(k + (row - (len(groups) - 1) / 2) * width, v) for k, v in enumerate(values) if len(v)]
        if boxes:
            ax.boxplot([v for _, v in boxes], positions=[at for at, _ in boxes], widths=0.8 * width,
                       whiskerprops=ink, capprops=ink, medianprops=ink, showfliers=False,
                       manage_ticks=False, patch_artist=True,
                       boxprops={"facecolor": ink["color"] + "60", "edgecolor": ink["color"]})  # fmt: skip
        ax.plot([], [], color=ink["color"], linewidth=6, alpha=0.6, label=in_words(name))
    ax.set_xticks(range(len(ticks)), ticks)
    ax.set_xlim(-0.6, len(ticks) - 0.4)


def draw_tracking(ax, times_s: dict[str, list[np.ndarray]], gap_s: float = 0.3) -> None:
    """A thin line per run, drawn where it has poses: ``times_s[method][run]``."""
    rows, at = [], 0
    for name, runs in times_s.items():
        rows.append(at + (len(runs) - 1) / 2)
        for t_s in runs:
            breaks = np.flatnonzero(np.diff(t_s) > gap_s) + 1
            for part in np.split(t_s, breaks):
                if len(part):
                    ax.plot(part[[0, -1]], [at, at], color=METHOD_COLOUR[name], solid_capstyle="butt")
            at += 1
        at += 2
    ax.set_yticks(rows, list(map(in_words, times_s)))
    ax.set_ylim(at - 1, -1)  # not inverted, which two axes that share it would undo
    ax.grid(axis="y", visible=False)
