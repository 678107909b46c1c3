"""What the chapter on failures shows: the poses found, reported or not, with their confidence."""

from __future__ import annotations

from collections.abc import Mapping
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
from .sliders import Step, picture
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


def draw_limit(limits: pd.DataFrame, limit: float):
    """Figure of one confidence threshold: right over wrong poses by camera, with a dot at the threshold, and
    beside them the percentages of right, wrong and no poses.

    Parameters
    ----------
    limits
        `right_and_wrong.by_limit` of one light, with ``modality``.
    """
    fig, (left, bars) = plt.subplots(1, 2, figsize=(7.6, 3.0), width_ratios=(3, 2))
    for y, modality in zip((1, 0), MODALITIES, strict=True):
        rows, colour = limits[limits.modality == modality], COLOUR[modality]
        at = rows[rows.limit == limit].iloc[0]
        left.plot(rows.wrong_percent, rows.right_percent, "-", lw=1, color=colour, label=CAMERAS[modality])
        left.plot(at.wrong_percent, at.right_percent, "o", ms=7, color=colour)
        parts = at.right_percent, 100 - at.right_percent - at.wrong_percent, at.wrong_percent
        ends = np.cumsum(parts)
        for width, end, shade in zip(parts, ends, ("truth", "ink", "event"), strict=True):
            bars.barh(y, width, left=end - width, height=0.5, color=COLOUR[shade],
                      alpha=0.3 if shade == "ink" else 1)  # fmt: skip
        bars.text(50, y - 0.42, "right {:.1f}, none {:.1f}, wrong {:.1f} %".format(*parts), ha="center",
                  size="small")  # fmt: skip
    left.set(xlabel="wrong poses (% of the images)", ylabel="right poses (% of the images)")
    left.margins(0.08)
    left.legend(loc="lower right")
    bars.set(xlim=(0, 100), ylim=(-0.7, 1.5), yticks=(1, 0), xlabel="% of the images",
             yticklabels=[CAMERAS[m] for m in MODALITIES])  # fmt: skip
    bars.grid(visible=False)
    return fig


def limit_steps(limits: pd.DataFrame) -> list[Step]:
    """A step of a `Slider` for each confidence threshold: `draw_limit`."""
    steps = []
    for limit in sorted(limits.limit.unique()):
        said = "; ".join(
            f"{CAMERAS[row.modality]}: {row.right_percent:.1f} % right, {row.wrong_percent:.1f} % wrong"
            for row in limits[limits.limit == limit].itertuples()
        )
        steps.append(Step(f"{limit:g}", said, picture(draw_limit(limits, limit)), ()))
    return steps
