"""Table and figure of networks of several widths, of the chapter on light networks."""

from __future__ import annotations

import matplotlib.pyplot as plt
import pandas as pd

from .drawings import COLOUR
from .tables import CAMERAS, LIGHTS, shares_with_ends

SIZES = {"robust": "robust, as it ships", "further": "robust, trained further",
         "1": "full width", "2": "half",
         "4": "a quarter", "8": "an eighth", "depthwise": "depthwise"}  # fmt: skip
TRAININGS = {"": "the truth", "-taught": "truth and robust", "-taught-seed1": "the same, second seed"}
SAME = ("robust", "further")  # sets of the full width with trainings of their own


def in_words(widths: pd.DataFrame) -> pd.DataFrame:
    """data/results/widths.csv with the ``size`` and the ``training`` that the name of each set says."""
    size = widths["set"].str.split("-").str[0]
    training = [name.removeprefix(s) for name, s in zip(widths["set"], size, strict=True)]
    return widths.assign(size=size, training=training)


def table(widths: pd.DataFrame) -> pd.DataFrame:
    """Texts by size and training: what a network for frames costs, and how well those of each camera do."""
    rows = in_words(widths)
    rows = rows.set_index([rows["size"].map(SIZES), rows.training.map(TRAININGS), "modality"])
    frames = rows.xs("rgb", level="modality")
    columns = {("cost", "parameters"): frames.parameters.map("{:,}".format),
               ("cost", "GFLOP"): (2 * frames.gmacs).map("{:.2f}".format),
               ("cost", "ms"): frames.ms.map("{:.0f}".format)}  # fmt: skip
    for modality in ("rgb", "event"):
        own = rows.xs(modality, level="modality")
        columns |= {(CAMERAS[modality], f"{part} overlap"): own[f"{name}_iou_high"].map("{:.2f}".format)
                    for name, part in (("ring", "ring"), ("reflector", "marker"))}  # fmt: skip
        columns |= {(CAMERAS[modality], f"{what} (%)"): shares_with_ends(own, what)
                    for what in ("right", "wrong")}  # fmt: skip
    of_size = pd.MultiIndex.from_product([SIZES.values(), TRAININGS.values()])
    order = [key for key in of_size if key in frames.index]
    return pd.DataFrame(columns).loc[order].rename_axis(index=("networks", "learn from"))


def beside_slim(joint: pd.DataFrame) -> pd.DataFrame:
    """Texts by camera and light, of one network with both masks and of the two of *slim*."""
    rows = joint.set_index(["modality", "light"])
    of = {name: rows[rows["set"] == name] for name in ("slim", "joint")}
    columns = {(f"{what} (%)", name): shares_with_ends(own, what, ".1f")
               for what in ("right", "wrong") for name, own in of.items()}  # fmt: skip
    masks = {"ring": "ring", "reflector": "marker"}
    columns |= {(f"{part} overlap", name): own[f"{mask}_iou"].map("{:.2f}".format)
                for mask, part in masks.items() for name, own in of.items()}  # fmt: skip
    return pd.DataFrame(columns).rename(index=CAMERAS | LIGHTS).rename_axis([None, None])


def draw(widths: pd.DataFrame):
    """Right poses (above) and the ring's overlap (below) in high light over the operations of a network, a
    column for each camera."""
    rows = in_words(widths)
    rows = rows.assign(gflop=2 * rows.gmacs, depthwise=rows["size"] == "depthwise")
    fig, axes = plt.subplots(2, 2, figsize=(7.6, 5), sharex=True, sharey="row")
    for column, (modality, own) in zip(axes.T, rows.groupby("modality", sort=False), strict=True):
        colour, widths_only = COLOUR[modality], own[~own["size"].isin(SAME) & ~own.depthwise]
        series = (("learned from the truth", widths_only[widths_only.training == ""], "o-", colour),
                  ("and from robust", widths_only[widths_only.training != ""], "o", "none"),
                  ("depthwise", own[own.depthwise], "D", "none"),
                  ("robust", own[own["set"] == "robust"], "*", colour))  # fmt: skip
        for label, points, marker, face in series:
            style = {"fmt": marker, "color": colour, "markerfacecolor": face, "label": label,
                     "ms": 11 if label == "robust" else 6, "elinewidth": 0.8}  # fmt: skip
            away = points[["right_low", "right_high"]].sub(points.right_percent, axis=0).abs().T
            column[0].errorbar(points.gflop, points.right_percent, away.to_numpy(), **style)
            column[1].errorbar(points.gflop, points.ring_iou_high, **style)
        column[0].set(title=CAMERAS[modality], ylim=(0, 103))
        column[1].set(xlabel="operations for an image (GFLOP)", xscale="log", ylim=(0, 1))
        column[1].set_xticks([0.2, 0.5, 1, 2, 5, 10], ["0.2", "0.5", "1", "2", "5", "10"])
        column[1].minorticks_off()
    axes[0, 0].set_ylabel("right poses (%)")
    axes[1, 0].set_ylabel("ring, mean overlap")
    axes[1, 0].legend(fontsize=8, loc="lower right")
    return fig
