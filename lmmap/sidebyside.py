"""What the studies on recordings gave, beside the paper and the bench, each part marked."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd

from . import accuracy
from .results import load_json

KEYS = ["training", "outlier_filter", "metric", "statistic", "light", "modality"]
STUDIES = {"hard": "hard cases", "false": "false detections", "odometry": "odometry"}


def side_by_side(out: Path, bench: Path) -> pd.DataFrame:
    """Table I's cells: ``published``, the ``bench``'s where it was run, and ``recordings: NAME``."""
    table = accuracy.compare(out).rename(columns={"ours": f"recordings: {out.name}"}).drop(columns="printed")
    if (bench / "summary.csv").exists():
        ours = accuracy.compare(bench)[[*KEYS, "ours"]].rename(columns={"ours": "bench"})
        table = table.merge(ours, on=KEYS, how="left")
    else:
        table["bench"] = float("nan")
    return table[[*KEYS, "published", "bench", f"recordings: {out.name}"]]


def told(out: Path, bench: Path) -> str:
    """All results of a folder as text, each part marked."""
    about, mark = load_json(out / "about.json"), f"recordings: {out.name}"
    parts = []
    for name, title in STUDIES.items():
        if (out / f"{name}.csv").exists():
            parts.append(
                f"{title} ({mark})\n{pd.read_csv(out / f'{name}.csv').round(3).to_string(index=False)}"
            )
    if about["left_out"]:
        parts.append("left out\n" + "\n".join(about["left_out"]))
    if about["rig"] and about["rig"].get("file_in_doubt"):
        parts.append(f"the hand-eye file and the detections do not agree: {json.dumps(about['rig'])}")
    if (out / "summary.csv").exists():
        whole = pd.read_csv(out / "summary.csv")
        other = whole[~whole.light.isin(accuracy.LIGHTS) & (whole.statistic != "rmse")]
        if len(other):
            parts.append(f"lights that are not the paper's ({mark})\n{other.round(3).to_string(index=False)}")
        table = side_by_side(out, bench).query("outlier_filter == 'without' and statistic != 'rmse'")
        text = table.drop(columns="outlier_filter").round(3).to_string(index=False)
        parts.append(f"table ({mark}; medians, and detections in percent)\n{text}")
    return "\n\n".join(parts)
