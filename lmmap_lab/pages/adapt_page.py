"""Figures and tables of the chapter on networks that learn a place by themselves."""

from __future__ import annotations

from itertools import product

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from lmmap.evaluation.error_table import errors
from lmmap.settings import MODALITIES

from ..studies import places
from ..studies.table1 import LIGHTS
from .drawings import COLOUR
from .tables import CAMERAS, shares_with_ends
from .tables import LIGHTS as WORDS


def draw_places(images: pd.DataFrame):
    """Right poses of each recording before and after, joined by a line, and wrong ones as crosses: a panel a
    light, frames over events.

    Parameters
    ----------
    images : what benchmarks/adapt_places.py keeps of each image
    """
    table = places.by_recording(images)
    lights = [light for light in LIGHTS if light in table.index.get_level_values("light")]
    fig, axes = plt.subplots(1, len(lights), figsize=(7.6, 3.6), sharex=True, squeeze=False)
    for ax, light in zip(axes[0], lights, strict=True):
        cell = table.loc[light].sort_index(level=["modality", "judged_on"], ascending=[True, True])
        for y, ((*_, modality), row) in enumerate(cell.iterrows()):
            before, after = row["right"][["before", "after"]]
            ax.plot([before, after], [y, y], color=COLOUR[modality], lw=1.2)
            ax.plot(before, y, "o", ms=5, color=COLOUR[modality], markerfacecolor="white")
            ax.plot(after, y, "o", ms=5, color=COLOUR[modality])
            ax.plot(row["wrong", "after"], y, "x", ms=4, color=COLOUR["ink"])
        ax.set(title=WORDS[light], xlim=(-3, 103), xlabel="images (%)", yticks=[])
    handles = camera_handles()
    handles += [plt.Line2D([], [], ls="", marker=m, color=COLOUR["ink"], markerfacecolor=f, label=name)
                for name, m, f in (("right before", "o", "white"), ("right after", "o", COLOUR["ink"]),
                                   ("wrong after", "x", None))]  # fmt: skip
    fig.legend(handles=handles, ncols=5, loc="outside lower center", fontsize=8)
    return fig


def light_table(images: pd.DataFrame) -> pd.DataFrame:
    """Texts by light and camera: right and wrong poses before and after, with 95 % intervals."""
    cells = places.means(images).set_index(["light", "modality", "when"])
    text = pd.DataFrame({what: shares_with_ends(cells, what, ".1f") for what in places.COUNTED})
    shown = text.unstack("when")[[(w, k) for w in places.COUNTED for k in places.WHEN]]
    shown[("", "recordings")] = cells.recordings.xs("before", level="when")
    order = [(light, m) for light in LIGHTS for m in ("rgb", "event") if (light, m) in shown.index]
    shown = shown.loc[order].rename(index=WORDS | CAMERAS)
    return shown.rename(columns={w: f"{w} (%)" for w in places.COUNTED}, level=0).rename_axis(
        index=["", ""], columns=[None, None]
    )


def whole_table(half: pd.DataFrame, whole: pd.DataFrame) -> pd.DataFrame:
    """Texts by camera: right and wrong poses before, and after networks have learned the first half of the
    recordings or all of them, with 95 % intervals.

    Parameters
    ----------
    half, whole : what benchmarks/adapt_places.py keeps of each image of the same recordings
    """
    kinds = {"before": (half, "before"), "after the first half": (half, "after"),
             "after all of it": (whole, "after")}  # fmt: skip
    cells = pd.concat(
        {
            name: places.means(images, ["modality"]).query("when == @when").set_index("modality")
            for name, (images, when) in kinds.items()
        }
    ).swaplevel()
    order = [(m, name) for m in MODALITIES for name in kinds]
    shown = pd.DataFrame({f"{what} (%)": shares_with_ends(cells, what, ".1f") for what in places.COUNTED})
    return shown.loc[order].rename(index=CAMERAS).rename_axis(index=["", ""])


def carried_table(images: pd.DataFrame) -> pd.DataFrame:
    """How many poses of events are right and wrong on other recordings of the places that taught, before and
    after, by the light of either."""
    table = places.carried(images, "event")
    shown = table[[(what, when) for what in places.COUNTED for when in places.WHEN]].astype(int)
    shown[("", "images")] = table["images", "before"].astype(int)
    order = [pair for pair in product(LIGHTS, LIGHTS) if pair in shown.index]
    return (
        shown.loc[order]
        .rename(index=WORDS)
        .rename_axis(index=["taught by", "judged on"], columns=[None, None])
    )


def before_and_after(recording, before, after, held_out: np.ndarray, port) -> pd.DataFrame:
    """How many rings and poses are found in images that taught and in those that were held out, and how far
    the poses are off.

    Parameters
    ----------
    before, after : `self_labels.Look` of each image
        Of the same images, by networks from before and by those that learned.
    held_out : bool (N,)
    """
    rows = {}
    for kind, chosen in (("taught", ~held_out), ("held out", held_out)):
        for when, looks in (("before", before), ("after", after)):
            estimates = [look.estimate for look, taken in zip(looks, chosen, strict=True) if taken]
            off_mm = 1e3 * errors(recording, estimates, port).position_error_m
            rows[kind, when] = {
                "images": len(estimates), "rings": sum(e.ellipse is not None for e in estimates),
                "poses": off_mm.notna().sum(), "largest position error (mm)": off_mm.max(),
            }  # fmt: skip
    table = pd.DataFrame(rows).T
    return table.style.format("{:.0f}", na_rep="")


def draw_gap(table: pd.DataFrame):
    """Right poses of the high-gap networks over the seconds from which they learned, and of the low-gap
    networks, which had labels, as dashed lines: a panel a light.

    Parameters
    ----------
    table : `places.by_seconds`
    """
    lights = [light for light in LIGHTS if light in set(table.light)]
    fig, axes = plt.subplots(1, len(lights), figsize=(3 + 1.6 * len(lights), 2.8), sharey=True, squeeze=False)
    lowest = 10 * (table.right_percent.min() // 10) - 10
    for ax, light in zip(axes[0], lights, strict=True):
        for modality in MODALITIES:
            cell = table[(table.light == light) & (table.modality == modality)].set_index("seconds")
            learned, labelled = (cell[cell.weights == gap].right_percent for gap in ("high", "low"))
            ax.plot(learned.index, learned, "o-", ms=4, color=COLOUR[modality])
            ax.axhline(labelled.iloc[0], ls="--", lw=1, color=COLOUR[modality])
        ax.set(title=WORDS[light], xlabel="learned from (s)", ylim=(lowest, 102))
    axes[0, 0].set(ylabel="right poses (%)")
    labels = plt.Line2D([], [], ls="--", color=COLOUR["ink"], label="low-gap networks, with labels")
    fig.legend(handles=[*camera_handles(), labels], ncols=3, loc="outside lower center", fontsize=8)
    return fig


def camera_handles() -> list[plt.Line2D]:
    """A legend's lines for the two cameras."""
    return [plt.Line2D([], [], marker="o", color=COLOUR[m], label=CAMERAS[m]) for m in MODALITIES]


def label_kinds(poses_own: np.ndarray, poses_track: np.ndarray) -> pd.Series:
    """How many images are taught by their own pose, by the track, or not at all; of flags (N,)."""
    own, track = np.asarray(poses_own, bool), np.asarray(poses_track, bool)
    counts = {"its own pose": own.sum(), "the track": (track & ~own).sum(), "nothing": (~own & ~track).sum()}
    return pd.Series(counts, name="images")
