"""Results on the authors' bags beside the paper's and the bench's; each title names its source."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd

from ..provenance import load_json
from ..studies import table1
from ..studies.on_authors_bags import BY_ITSELF
from .tables import accuracy_table

KEYS = ["training", "outlier_filter", "metric", "statistic", "light", "modality"]
STUDIES = {"hard": "hard cases", "false": "false detections", "odometry": "odometry",
           "misalignment": "misalignment of the truth, and the errors without it"}  # fmt: skip


def side_by_side(out: Path, bench: Path) -> pd.DataFrame:
    """Cells of Table I: the paper's ``table1``, ``bench`` (NaN if it was not run), ``recordings: NAME``.

    Parameters
    ----------
    out, bench : folders with the results on recordings and on the bench
    """
    table = table1.compare(out).rename(columns={"ours": f"recordings: {out.name}"}).drop(columns="printed")
    if (bench / "summary.csv").exists():
        ours = table1.compare(bench)[[*KEYS, "ours"]].rename(columns={"ours": "bench"})
        table = table.merge(ours, on=KEYS, how="left")
    else:
        table["bench"] = float("nan")
    return table[[*KEYS, "table1", "bench", f"recordings: {out.name}"]]


def tables(out: Path, bench: Path) -> dict[str, pd.DataFrame]:
    """All results of a folder in three digits, by titles with its name; the paper's table comes last."""
    mark, results = f"recordings: {out.name}", {}
    for name, title in STUDIES.items():
        if (out / f"{name}.csv").exists():
            results[f"{title} ({mark})"] = _short(pd.read_csv(out / f"{name}.csv"))
    if (out / "summary.csv").exists():
        whole = pd.read_csv(out / "summary.csv").query("statistic != 'rmse'")
        by_itself = _before_and_after(whole)
        if len(by_itself):
            results[f"networks that learned the laboratory by themselves ({mark})"] = by_itself
        whole = whole[~whole.training.isin(BY_ITSELF)]
        other = whole[~whole.light.isin(table1.LIGHTS)]
        if len(other):
            results[f"lights that are not the paper's ({mark})"] = _short(other)
        cells = side_by_side(out, bench).query("outlier_filter == 'without' and statistic != 'rmse'")
        for training, quarter in cells.groupby("training"):
            text = accuracy_table(
                quarter, ("median", "in_fov", "all"), {"table1": "paper", "bench": "bench", mark: mark}
            )
            results[f"table ({mark}; {training}, medians)"] = text.dropna(axis=1, how="all")
    return results


def _before_and_after(summary: pd.DataFrame) -> pd.DataFrame:
    """Medians and detection rates of the default networks, a column each: before and after they learned."""
    cells = summary[summary.training.isin(BY_ITSELF)]
    cells = cells.query("variant == 'exact' and outlier_filter == 'without' and statistic != 'all'")
    return _short(cells.pivot(index=["metric", "light", "modality"], columns="training", values="value"))


def _short(table: pd.DataFrame) -> pd.DataFrame:
    return table.map(lambda value: f"{value:.3g}" if isinstance(value, float) else value)


def results_text(out: Path, bench: Path) -> str:
    """All results of a folder as text, each table under its title."""
    about = load_json(out / "about.json")
    parts = ["left out\n" + "\n".join(about["left_out"])] if about["left_out"] else []
    if about["rig"] and about["rig"].get("file_in_doubt"):
        parts.append(f"the hand-eye file and the detections do not agree: {json.dumps(about['rig'])}")
    for title, table in tables(out, bench).items():
        has_names = isinstance(table.index, pd.MultiIndex)
        parts.append(f"{title}\n{table.to_string(index=has_names)}")
    return "\n\n".join(parts)
