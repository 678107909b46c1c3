"""Tables of the chapter on hard cases and fusion."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from ..provenance import DATA
from .tables import CAMERAS, LIGHTS, WORDS


def hard_case_table(counts: pd.DataFrame, cases: Mapping[str, str]):
    """Success in percent and median errors, styled.

    Parameters
    ----------
    counts
        Of the study, with the index ``sequence, modality``.
    cases
        Titles by sequence, of the sequences that the table shows; the paper's numbers have the same titles.
    """
    paper = pd.read_csv(DATA / "paper" / "other_results.csv").query("where == 'hard cases'")
    rows = []
    for (name, modality), c in counts[counts.index.isin(cases, level=0)].iterrows():
        reported = paper[(paper.condition == cases[name]) & paper.quantity.str.endswith(modality)].value
        rows.append({
            "case": cases[name], "camera": CAMERAS[modality],
            "ellipse, paper (%)": float(reported.item()) if len(reported) else np.nan,
            "ellipse, ours (%)": 100 * c.ellipses / c.images if modality != "fused" else np.nan,
            "pose, ours (%)": 100 * c.poses / c.images, "our images": c.images,
            "off by (mm)": 1e3 * c.position_error_m, "normal (°)": c.normal_error_deg,
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
        value, lower, upper = scale * np.array([row.difference, row.low, row.high])
        text = f"{value:+.2f} ({lower:+.2f} to {upper:+.2f})"
        rows.append((LIGHTS[row.light], WORDS[row.metric, "median"], CAMERAS[row.better], text))
    columns = ["light", "median error", "better camera", "fused minus better"]
    return pd.DataFrame(rows, columns=columns).set_index(columns[:2])
