"""What the chapter on the paper port shows: its clip, and five experiments on it."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from lmmap.evaluation.pose_errors import normal_error_rad
from lmmap.pipeline.agreement import alike
from lmmap.settings import OURS
from lmmap.types import Camera, Estimate, Port, Trajectory

from ..paper_port.experiments import PARTS, SLIDE_MM
from .drawings import COLOUR, draw_estimate

SHOWN = {"wave": "waved", "slide": "1 slid", "turned": "2 turned", "cover": "3 covered", "lamp": "4 lamp",
         "flat": "5 flat"}  # fmt: skip


def verdicts(estimates: Sequence[Estimate], truth: Trajectory, port: Port) -> pd.DataFrame:
    """``part``, ``status`` and ``verdict`` (right, wrong, none) of each image of the clip, by the limits of
    `OURS`."""
    rows = []
    for name, part in PARTS.items():
        for k in range(part.start, part.stop):
            T, true = estimates[k].T_cam_port, truth.poses[k]
            verdict = "none" if T is None else "right" if alike(T, true, port, OURS) else "wrong"
            rows.append((name, str(estimates[k].status), verdict))
    return pd.DataFrame(rows, columns=["part", "status", "verdict"])


def count_verdicts(table: pd.DataFrame) -> pd.DataFrame:
    """Images of each part by their verdict, in the order of the clip."""
    counts = pd.crosstab(table.part, table.verdict).reindex(index=list(PARTS), fill_value=0)
    return counts.reindex(columns=["right", "wrong", "none"], fill_value=0)


def normal_error_deg(estimates: Sequence[Estimate], truth: Trajectory, name: str) -> float:
    """Median error of the normals that were found in a part of the clip."""
    part = range(PARTS[name].start, PARTS[name].stop)
    found = [(estimates[k].T_cam_port, truth.poses[k]) for k in part if estimates[k].T_cam_port is not None]
    return float(np.degrees(np.median([normal_error_rad(T, true) for T, true in found])))


def slid_mm(estimates: Sequence[Estimate]) -> np.ndarray:
    """How far the port has moved at each image with a pose of the part "slide", since its first, and what the
    ruler says, (2, N) mm."""
    pairs = zip(SLIDE_MM, estimates[PARTS["slide"]], strict=True)
    found = [(ruler, e.T_cam_port.position_m) for ruler, e in pairs if e.T_cam_port is not None]
    ruler, position_m = (np.array(values) for values in zip(*found, strict=True))
    return np.stack([1e3 * np.linalg.norm(position_m - position_m[0], axis=1), ruler - ruler[0]])


def draw(frames, estimates: Sequence[Estimate], truth: Trajectory, port: Port, camera: Camera):
    """An image of each part with its estimate and its true pose."""
    fig, axes = plt.subplots(2, 3, figsize=(7.6, 4.3))
    for ax, (name, title) in zip(axes.flat, SHOWN.items(), strict=True):
        k = (PARTS[name].start + PARTS[name].stop) // 2
        draw_estimate(ax, frames[k], estimates[k], port, camera, truth.poses[k])
        ax.set_title(f"{title}: {estimates[k].status}", fontsize=9)
    return fig


def draw_slide(estimates: Sequence[Estimate]):
    """Where the poses are, over where the ruler says that the port is."""
    moved_mm, ruler_mm = slid_mm(estimates)
    fig, (ax, rest) = plt.subplots(1, 2, figsize=(7.6, 2.8))
    ax.plot(ruler_mm, ruler_mm, color=COLOUR["truth"], label="ruler")
    ax.plot(ruler_mm, moved_mm, "o", ms=4, color=COLOUR["ours"], label="poses")
    ax.set(xlabel="ruler (mm)", ylabel="distance of the poses (mm)")
    ax.legend()
    rest.axhline(0, color=COLOUR["truth"])
    rest.plot(ruler_mm, moved_mm - ruler_mm, "o", ms=4, color=COLOUR["ours"])
    rest.set(xlabel="ruler (mm)", ylabel="difference (mm)")
    return fig
