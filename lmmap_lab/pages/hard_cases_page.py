"""Hard cases and fusion: tables and figures of the chapter on both cameras, and of the appendix."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from lmmap.settings import OURS

from ..bench.event_sensor import SensorSettings
from ..provenance import DATA
from .drawings import COLOUR, draw_intervals
from .tables import CAMERAS, LIGHTS, WORDS, with_ends

ERRORS = (  # metric, label, scale
    ("position_error_m", "position (mm)", 1e3), ("normal_error_deg", "normal (°)", 1.0),
    ("rotation_error_deg", "rotation (°)", 1.0),
)  # fmt: skip
NOISE_HZ = (0.1, 0.2, 0.5, 1, 2, 5)  # marks of the axis


def paper_success(case: str, modality: str) -> float:
    """The paper's percentage of images with an ellipse in a hard case; NaN where it has none."""
    reported = pd.read_csv(DATA / "paper" / "other_results.csv").query("where == 'hard cases'")
    value = reported[(reported.condition == case) & reported.quantity.str.endswith(modality)].value
    return float(value.item()) if len(value) else np.nan


def hard_case_table(counts: pd.DataFrame, cases: Mapping[str, str]):
    """Success in percent and median errors, styled.

    Parameters
    ----------
    counts
        Of the study, with the index ``sequence, modality``.
    cases
        Titles by sequence, of the sequences that the table shows; the paper's numbers have the same titles.
    """
    rows = []
    for (name, modality), c in counts[counts.index.isin(cases, level=0)].iterrows():
        rows.append({
            "case": cases[name], "camera": CAMERAS[modality],
            "ellipse, paper (%)": paper_success(cases[name], modality),
            "ellipse, ours (%)": 100 * c.ellipses / c.images if modality != "fused" else np.nan,
            "pose, ours (%)": 100 * c.poses / c.images, "our images": c.images,
            "position error (mm)": 1e3 * c.position_error_m, "normal error (°)": c.normal_error_deg,
        })  # fmt: skip
    table = pd.DataFrame(rows).set_index(["case", "camera"]).rename_axis(index=(None, None))
    return table.style.format(precision=1, na_rep="–").format("{:.0f}", subset=["our images"])


def fusion_table(differences: pd.DataFrame) -> pd.DataFrame:
    """The fused track beside the better camera: a row per light and median error.

    Parameters
    ----------
    differences
        `error_statistics.against_better` by ``light``.

    Returns
    -------
    DataFrame
        Which camera is the better one, and by how much the fused track's median error is above its, with the
        95 % interval in brackets.
    """
    rows = []
    for row in differences.itertuples():
        scale = 1e3 if row.metric == "position_error_m" else 1.0
        text = with_ends(*(scale * np.array([row.difference, row.low, row.high])), "+.2f")
        rows.append((LIGHTS[row.light], WORDS[row.metric, "median"], CAMERAS[row.better], text))
    columns = ["light", "median error", "better camera", "fused minus better"]
    return pd.DataFrame(rows, columns=columns).set_index(columns[:2])


def draw_fused(cells: pd.DataFrame):
    """Figure of the median errors of each camera and of both fused, with their 95 % intervals, by light.

    Parameters
    ----------
    cells
        The study's summary, of one estimator and by ``metric, statistic, light, modality``.
    """
    fig, axes = plt.subplots(1, len(ERRORS), figsize=(7.5, 2.9))
    for ax, (metric, label, scale) in zip(axes, ERRORS, strict=True):
        for shift, m in ((-0.2, "rgb"), (0, "event"), (0.2, "fused")):
            cell = cells.loc[metric].xs("median").xs(m, level="modality").loc[list(LIGHTS)]
            cell = scale * cell[["value", "low", "high"]]
            x = np.arange(len(LIGHTS)) + shift
            draw_intervals(ax, x, cell.value, cell.low, cell.high, COLOUR[m], CAMERAS[m])
        ax.set(title=label, ylim=(0, None), xlabel="light")
        ax.set_xticks(range(len(LIGHTS)), LIGHTS)
    axes[0].set_ylabel("median error")
    axes[-1].legend(fontsize=8)
    return fig


def slow_shares(counts: pd.DataFrame, bench: pd.DataFrame) -> pd.DataFrame:
    """Slow motion's histograms by set of networks: with an ellipse, a pose, a right and a wrong one, percent.

    Parameters
    ----------
    counts : the study's ``images, ellipses, poses`` by ``sequence`` and ``modality``, of the low-gap networks
    bench : rows of the study `noise`, of the default networks
    """
    low = counts[(counts.sequence == "hard-slow") & (counts.modality == "event")].iloc[0]
    own = bench[bench.shot_hz == SensorSettings().shot_hz].iloc[0]
    rows = {
        "low gap": [low.images, *(100 * low[["ellipses", "poses"]] / low.images), np.nan, np.nan],
        f"default ({OURS.weights})": [own.images, own.ellipse_percent, 100 - own.none_percent,
                                      own.right_percent, own.wrong_percent],
    }  # fmt: skip
    columns = ["histograms", "an ellipse (%)", "a pose (%)", "a right pose (%)", "a wrong pose (%)"]
    return pd.DataFrame(rows, index=columns).T.astype({"histograms": int})


def draw_noise(ax, bench: pd.DataFrame, paper_percent: float) -> None:
    """Success in slow motion against the noise of a pixel, our sensor and the paper's success as lines."""
    for column, mark, label in (("ellipse_percent", "o", "ellipse"), ("right_percent", "s", "right pose")):
        ax.plot(bench.background_hz, bench[column], f"{mark}-", color=COLOUR["event"], label=label, ms=5,
                alpha=1.0 if mark == "o" else 0.6)  # fmt: skip
    ours_hz = bench[bench.shot_hz == SensorSettings().shot_hz].background_hz.item()
    ax.axvline(ours_hz, color=COLOUR["ink"], lw=1, label="our sensor")
    ax.axhline(paper_percent, color=COLOUR["paper"], ls="--", lw=1.3, label="the paper's ellipses")
    ax.set(xlabel="noise (events per second and pixel)", ylabel="histograms (%)")
    ax.set_xscale("log")
    ax.set_xticks(NOISE_HZ, [f"{hz:g}" for hz in NOISE_HZ], minor=False)
    ax.set_xticks([], minor=True)
    ax.legend(fontsize=8)
