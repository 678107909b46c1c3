"""What the networks find in the published pictures: outlines and numbers; the pictures are the authors'.

Also what a wrong CAD does to poses, and how an arm's motion leads to the true pose.
"""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.collections import PolyCollection

from lmmap.evaluation import error_table
from lmmap.types import Ellipse, Estimate, Port, Recording

from ..studies.any_lens import markers_px
from .drawings import COLOUR, draw_ellipse, look_at
from .tables import ANSWERS

AROUND = 1.6  # half the width of a drawing, in semi-major axes of the ring
SETS = {"high": "high gap", "low": "low gap", "robust": "default"}  # of networks, as the tables call them


def draw_outlines(outlines: Mapping[str, dict], titles: Mapping[str, str]):
    """Figure with a column for each picture of ``titles`` and a row for each set of networks.

    Parameters
    ----------
    outlines
        By picture, as tuning/judge_pictures.py writes them.
    """
    gaps = [gap for gap in SETS if gap in outlines[next(iter(titles))]]
    size = (7.6, 7.6 / len(titles) * len(gaps) + 0.4)
    fig, axes = plt.subplots(len(gaps), len(titles), figsize=size, squeeze=False)
    for column, (name, title) in zip(axes.T, titles.items(), strict=True):
        outer = _ellipse(outlines[name]["outer"])
        for ax, gap in zip(column, gaps, strict=True):
            _draw(ax, outlines[name][gap], outer)
            ax.set_title(f"{title}\n{SETS[gap]}" if ax is column[0] else SETS[gap], fontsize=8)
    return fig


def _draw(ax, outlines: dict, outer: Ellipse) -> None:
    mask = [np.array([pair.split(",") for pair in text.split()], float) for text in outlines["mask"]]
    ax.add_collection(PolyCollection(mask, facecolor="none", edgecolor=COLOUR["ours"], lw=0.7))
    draw_ellipse(ax, outer, COLOUR["truth"], lw=1.2, ls="--")
    if outlines["ellipse"] is not None:
        port, ring = Port.lm_map(), _ellipse(outlines["ellipse"])
        widen = port.ring_outer_radius_m / port.ring_radius_m
        draw_ellipse(ax, Ellipse(ring.centre_px, widen * ring.semi_axes_px, ring.angle_rad), COLOUR["event"])
    look_at(ax, outer, AROUND)
    ax.set(xticks=[], yticks=[], aspect="equal")
    ax.spines[:].set_visible(False)
    ax.set_label("outlines of the mask, the ring by hand and the ellipse")


def _ellipse(values) -> Ellipse:
    u, v, major, minor, angle_rad = values
    return Ellipse(np.array([u, v]), np.array([major, minor]), angle_rad)


def found_table(pictures: pd.DataFrame, what: pd.DataFrame) -> pd.DataFrame:
    """A row per picture, a column per set of networks: what is found, and whether the ring is right.

    Parameters
    ----------
    pictures
        Rows of data/results/pictures.csv, one for each picture and set.
    what
        data/paper/pictures.csv by picture.
    """
    visible = pictures.groupby("picture").major_ratio.apply(lambda ratio: ratio.notna().any())
    texts = pictures.assign(text=[_said(row) for row in pictures.itertuples()])
    table = texts.pivot(index="picture", columns="filters", values="text")
    table = table[[gap for gap in SETS if gap in table]].rename(columns=SETS)
    order = visible.sort_values(ascending=False, kind="stable").index
    return table.loc[order].rename(index=what.what).rename_axis(index=None, columns=None)


def found_counts(pictures: pd.DataFrame, visible: list[str]) -> pd.DataFrame:
    """Right rings without and with the local search, and reported poses, in the ``visible`` pictures.

    There is a row for each set of networks.  ``pictures`` as in `found_table`, without and with that search.
    """
    seen = pictures[pictures.picture.isin(visible)]
    rings = seen.pivot_table(index="filters", columns="local_search", values="ring_right", aggfunc="sum")
    posed = seen[seen.local_search & (seen.status == "ok")].groupby("filters").ring_right
    counts = {"right rings, no local search": rings[False], "right rings, local search": rings[True],
              "poses": posed.size(), "poses with a wrong ring": posed.size() - posed.sum()}  # fmt: skip
    table = pd.DataFrame(counts).loc[list(SETS)].fillna(0).astype(int)
    return table.rename(index=SETS).rename_axis(index=None)


def _said(row) -> str:
    if np.isnan(row.contrast):
        return ANSWERS[row.status]
    if not row.ring_right:
        return "a wrong ring"
    return f"ring, {row.centre_px:.1f} px off" + (", pose" if row.pose_plausible else "")


def judge_cad(recording: Recording, estimates: list[Estimate], cad: Port, port: Port) -> dict[str, float]:
    """Medians over estimates that were made with ``cad`` of a recording that shows ``port``."""
    posed = [e for e in estimates if e.T_cam_port is not None]
    off = error_table.errors(recording, posed, port).median(numeric_only=True)
    truths = recording.truth.at(np.array([e.t_us for e in posed]))
    drawn_px = [markers_px(e.T_cam_port, cad, recording.camera) for e in posed]
    true_px = [markers_px(T, port, recording.camera) for T in truths]
    return {
        "position error (mm)": 1e3 * off.position_error_m,
        "normal error (°)": off.normal_error_deg,
        "drawn marker error (px)": np.median([*map(_apart, drawn_px, true_px)]),
        "confidence": np.median([e.confidence for e in posed]),
        "markers off CAD (px)": np.median([e.markers_off_px for e in posed]),
    }


def _apart(corners_px, others_px) -> float:
    """Root mean square distance of corners (..., 2) from the nearest of others."""
    between = corners_px.reshape(-1, 1, 2) - others_px.reshape(-1, 2)
    return float(np.sqrt((between**2).sum(-1).min(1).mean()))


def draw_chain(ax) -> None:
    """Camera, the arm's base and flange, and the port, with the transform that leads from each to the next.

    Solid arrows are known when a bag is read, and dashed ones are not.
    """
    places = {"camera": (0.4, 1.9), "arm's base": (3.1, 0.3), "flange": (6.3, 1.1), "port": (7.9, 2.2)}
    arm = np.array([places["arm's base"], (3.2, 1.3), (4.8, 2.1), (5.8, 1.5), places["flange"]])
    ax.plot(*arm.T, color=COLOUR["ink"], lw=6, alpha=0.25, solid_capstyle="round")
    for name, (x, y) in places.items():
        ax.plot(x, y, "s", color=COLOUR["ink"], ms=8)
        above = name == "port"
        ax.text(x, y + (0.2 if above else -0.22), name, ha="center", va="bottom" if above else "top")
    arrows = (  # from, to, what it says and where
        ("camera", "arm's base", "hand-eye file", (1.35, 0.75), "rgb", "-", -0.15),
        ("arm's base", "flange", "the arm says (/tf)", (5.0, 0.5), "rgb", "-", -0.25),
        ("flange", "port", "not published", (7.95, 1.3), "event", "--", 0.2),
        ("camera", "port", "what our method measures", (4.15, 3.55), "truth", "-", -0.3),
    )
    for start, end, said, at, colour, style, bend in arrows:
        path = {"arrowstyle": "->", "color": COLOUR[colour], "ls": style, "lw": 1.8, "shrinkA": 9,
                "shrinkB": 9, "connectionstyle": f"arc3,rad={bend}"}  # fmt: skip
        ax.annotate("", places[end], places[start], arrowprops=path)
        ax.text(*at, said, ha="center", va="center", fontsize=9, color=COLOUR[colour])
    ax.set(xlim=(-0.4, 8.6), ylim=(-0.4, 3.8))
    ax.set_label("camera, base, flange and port, and the four transforms between them")
    ax.set_axis_off()
