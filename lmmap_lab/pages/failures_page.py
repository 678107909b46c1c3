"""What the chapter on failures shows: the poses found, reported or not, with their confidence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from lmmap.evaluation.error_table import METRICS, errors, is_wrong
from lmmap.recordings.formats import open_recording
from lmmap.recordings.pose_files import read_estimates
from lmmap.settings import MODALITIES
from lmmap.types import Port

from ..studies.reliability import share_intervals
from .drawings import COLOUR
from .tables import CAMERAS, LIGHTS

BESIDE = 0.97  # a confidence near the corner of a plot


def found_poses(folder: Path, labels: Mapping[str, tuple[str, str]]) -> pd.DataFrame:
    """A row for each image with the ring in view, with the errors of the pose found, reported or not.

    Parameters
    ----------
    folder
        With ``NAME.h5`` and ``estimates-LABEL.csv``.
    labels
        ``(sequence, modality)`` by label.

    Returns
    -------
    DataFrame
        ``sequence, modality, label, t_us``; ``status`` and ``confidence`` of the answer; `METRICS` (NaN
        without a pose) and ``wrong`` of the pose found; and ``answer``, the estimate that reports it.
    """
    parts = []
    for label, (name, modality) in labels.items():
        recording = open_recording(folder / f"{name}.h5")
        reported = read_estimates(folder / f"estimates-{label}.csv")
        every = [e if e.doubtful is None else e.judged(e.confidence, 0.0) for e in reported]
        table = errors(recording, every, Port.lm_map())[["t_us", "in_view", *METRICS]]
        table = table.assign(sequence=name, modality=modality, label=label, wrong=is_wrong(table))
        answers = pd.DataFrame({"t_us": [e.t_us for e in every], "status": [str(e.status) for e in reported],
                                "confidence": [e.confidence for e in every], "answer": every})  # fmt: skip
        parts.append(table.merge(answers, on="t_us").query("in_view"))
    return pd.concat(parts, ignore_index=True)


def share_table(poses: pd.DataFrame, sure, titles: Mapping[str, str]) -> pd.DataFrame:
    """Right and wrong poses in percent of the images: a row per sequence of ``titles`` and camera.

    Parameters
    ----------
    poses
        Of `found_poses`.
    sure
        Booleans by row: whether a pose is among the confident ones.
    """
    found, wrong = poses.position_error_m.notna(), poses.wrong.astype(bool)
    columns = {(title, kind): 100 * (rows & of_kind)
               for title, rows in (("every pose", found), ("confident poses", found & sure))
               for kind, of_kind in (("right (%)", ~wrong), ("wrong (%)", wrong))}  # fmt: skip
    groups = pd.DataFrame(columns).groupby(
        [poses.sequence.map(titles), poses.modality.map(CAMERAS)], sort=False
    )
    table = groups.mean()
    table["", "images"] = groups.size()
    return table.rename_axis(index=(None, None))


def looks_table(tables: Mapping[str, pd.DataFrame]) -> pd.DataFrame:
    """Right and wrong poses in percent by the first look and by all, by table, light and camera.

    Parameters
    ----------
    tables
        By title: ``light``, ``camera``, ``looks``, ``right_percent``, ``wrong_percent`` and ``images``, of
        which several rows of one cell count by their images.
    """
    every = pd.concat([table.assign(place=title) for title, table in tables.items()])
    kinds = {"right_percent": "right (%)", "wrong_percent": "wrong (%)"}
    weighted = every.assign(**{kind: every[kind] * every.images for kind in kinds})
    sums = weighted.groupby(["place", "light", "camera", "looks"], sort=False)[[*kinds, "images"]].sum()
    shares = sums[list(kinds)].div(sums.images, axis=0).rename(columns=kinds).unstack()
    shares["", "images"] = sums.images.unstack().iloc[:, 0]
    order = pd.MultiIndex.from_product([tables, LIGHTS, CAMERAS]).intersection(shares.index, sort=False)
    shares = shares.loc[order].rename(index={**LIGHTS, **CAMERAS})
    return shares.rename_axis(index=(None,) * 3, columns=(None, None))


def seen_table(seen: pd.DataFrame) -> pd.DataFrame:
    """Rings that a person sees and right poses, of ``images, seen, right`` by ``modality`` and ``light``."""
    table = seen.assign(share=100 * seen.right / seen.seen)
    table = table.set_index([table.modality.map(CAMERAS), table.light.map(LIGHTS)])
    words = {"images": "images", "seen": "ring seen", "right": "pose right", "share": "right of seen (%)"}
    return table[list(words)].rename(columns=words).rename_axis(index=(None, None))


def cells_in_words(cells: pd.DataFrame) -> str:
    """Rows of ``modality`` and ``light`` as a list: frames in high light, events in every light."""
    lights = {CAMERAS[m]: list(rows.light) for m, rows in cells.groupby("modality", sort=False)}
    words = {m: "every" if set(LIGHTS) <= set(own) else " and ".join(own) for m, own in lights.items()}
    return ", ".join(f"{camera} in {own} light" for camera, own in words.items())


def draw_reliability(panels: Mapping[str, Mapping[str, pd.DataFrame]]):
    """Figure of `reliability.reliability`'s tables: the share of right poses over the confidence.

    Parameters
    ----------
    panels
        Tables by colour's name, by the panel's title.
    """
    fig, axes = plt.subplots(1, len(panels), figsize=(7.6, 3.6))
    for ax, (title, tables) in zip(axes, panels.items(), strict=True):
        ax.plot([0, 1], [0, 1], color=COLOUR["ink"], lw=0.8, ls="--")
        least = 1.0
        for above, (name, table) in zip((24, 11), tables.items(), strict=False):
            ends = share_intervals(table)
            ax.errorbar(table.confidence, table.right, np.abs(ends.T - table.right.to_numpy()), fmt="o",
                        color=COLOUR[name], capsize=2, label=CAMERAS.get(name, "both cameras"))  # fmt: skip
            for row in table.itertuples():  # the numbers stand in lines above the dots
                ax.annotate(f"{row.poses:,}", (row.confidence, 1), (0, above), textcoords="offset points",
                            ha="left" if row.confidence > BESIDE else "center", color=COLOUR[name],
                            size="small")  # fmt: skip
            least = min(least, ends.min(), table.confidence.min())
        least = np.floor(10 * least) / 10
        beyond = 1 + 0.25 * (1 - least)
        ax.set(title=title, xlabel="confidence", xlim=(least, beyond),
               ylim=(least - 0.05 * (1 - least), beyond))  # fmt: skip
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_ticks([tick for tick in axis.get_majorticklocs() if least <= tick < 1.01])
        ax.grid(axis="x", visible=False)
        ax.legend(loc="lower right")
    axes[0].set_ylabel("fraction of right poses")
    return fig


def draw_limits(limits: pd.DataFrame, light: str, labelled: Sequence[float]):
    """Figure of right over wrong poses in a light, as the confidence threshold varies: a curve a camera.

    Parameters
    ----------
    limits
        `right_and_wrong.by_limit` with ``light`` and ``modality``.
    labelled
        The thresholds that are written beside their dots.
    """
    fig, ax = plt.subplots(figsize=(5.6, 2.9))
    for modality in MODALITIES:
        rows = limits[(limits.light == light) & (limits.modality == modality)]
        ax.plot(rows.wrong_percent, rows.right_percent, "o-", ms=3.5, lw=1, color=COLOUR[modality],
                label=CAMERAS[modality])  # fmt: skip
        for k, row in enumerate(rows[rows.limit.isin(labelled)].itertuples()):  # in turn below and above
            ax.annotate(f"{row.limit:g}", (row.wrong_percent, row.right_percent),
                        (-4, 3) if k % 2 else (5, -11), textcoords="offset points",
                        ha="right" if k % 2 else "left", color=COLOUR[modality], size="small")  # fmt: skip
    ax.margins(0.08)
    ax.set(xlabel="wrong poses (% of the images)", ylabel="right poses (% of the images)")
    ax.legend(loc="lower right")
    return fig
