"""The paper's accuracy study: errors and detection rates of one recording, and of the bench's test."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from . import photometry, sequences
from .core import Estimate, Port, Pose, Recording
from .filters import shipped_gaps
from .geometry import in_view
from .metrics import normal_error_rad, position_error_m, rotation_error_rad
from .pipeline import Estimator, estimate, true_poses
from .quality import filter_quality
from .recordings import open_recording, write_npz
from .results import DATA, DERIVED, fingerprint, save_json, save_table
from .tracking import outlier_filter
from .trajectories import write_estimates

LIGHTS, MODALITIES, DOMAIN_GAPS = ("low", "medium", "high"), ("rgb", "event"), ("low", "high")
BENCH = [
    f"lmmap/{name}.py"
    for name in ("core", "geometry", "scene", "materials", "shading", "dvs", "laboratory", "sequences")
]
SEQUENCES = ("test-low", "test-medium", "test-high", "hard-slow", "hard-reflect", "empty-0")


def errors(recording: Recording, estimates: list[Estimate], port: Port) -> pd.DataFrame:
    """One row per estimate: status, in view or not, and the errors of our pose and of the paper's
    formula on the same ellipse (NaN where there is no pose)."""
    known, truth = true_poses(recording, estimates)
    table = pd.DataFrame({"t_us": [e.t_us for e in known], "status": [str(e.status) for e in known]})
    table["in_view"] = in_view(truth, port, recording.camera)
    table["kept"] = outlier_filter(known, port.yaw_period_rad)
    for name, poses in (("", [e.T_cam_port for e in known]), ("paper_", [e.paper for e in known])):
        found = np.array([p is not None for p in poses], bool)
        columns = (f"{name}position_error_m", f"{name}normal_error_deg", f"{name}rotation_error_deg")
        table[list(columns)] = np.nan
        if found.any():
            ours = _stack([p for p in poses if p is not None])
            table.loc[found, columns[0]] = position_error_m(ours, truth[found])
            table.loc[found, columns[1]] = np.rad2deg(normal_error_rad(ours, truth[found]))
            angle = rotation_error_rad(ours, truth[found], port.yaw_period_rad)
            table.loc[found, columns[2]] = np.rad2deg(angle)
    return table


def _stack(poses: list[Pose]) -> Pose:
    return Pose(np.stack([p.rotation for p in poses]), np.stack([p.position_m for p in poses]))


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Median and RMSE of each error, exact and printed formula, with and without outlier filter."""
    rows = []
    for kept in ("without", "with"):
        some = table[table.kept] if kept == "with" else table
        for metric in ("position_error_m", "normal_error_deg", "rotation_error_deg"):
            for formula, name in (("exact", metric), ("paper", f"paper_{metric}")):
                values = some[name].dropna()
                rows.append((kept, metric, formula, "median", values.median()))
                rows.append((kept, metric, formula, "rmse", np.sqrt((values**2).mean())))
        found = some.position_error_m.notna()
        rows.append((kept, "detection_rate_percent", "exact", "all", _percent(found.sum(), len(table))))
        seen = (found & some.in_view).sum()
        rows.append((kept, "detection_rate_percent", "exact", "in_fov", _percent(seen, table.in_view.sum())))
    return pd.DataFrame(rows, columns=["outlier_filter", "metric", "formula", "statistic", "value"])


def report(table: pd.DataFrame) -> dict:
    """The numbers that `lmmap evaluate` prints, without outlier filter."""
    found, seen = table.position_error_m.notna(), table.in_view
    return {
        "images": len(table),
        "images_with_ring_in_view": int(seen.sum()),
        "detected_of_all_percent": _percent(found.sum(), len(table)),
        "detected_of_in_view_percent": _percent((found & seen).sum(), seen.sum()),
        "position_error_median_mm": 1e3 * table.position_error_m.median(),
        "normal_error_median_deg": table.normal_error_deg.median(),
        "rotation_error_median_deg": table.rotation_error_deg.median(),
        "paper_formula_position_median_mm": 1e3 * table.paper_position_error_m.median(),
        "paper_formula_normal_median_deg": table.paper_normal_error_deg.median(),
        "paper_formula_rotation_median_deg": table.paper_rotation_error_deg.median(),
    }


def _percent(part, whole) -> float:
    return 100 * part / whole if whole else np.nan


def saturation(recording: Recording, port: Port) -> dict:
    """Share of the port's region of interest that is black or white, mean over frames."""
    found = []
    for frame, pose in zip(recording.frames, recording.truth.at(recording.frames_t_us), strict=True):
        region = sequences.label_masks(pose, port, recording.camera).any(0)
        if region.any():
            found.append(photometry.saturation(frame, region))
    low, high = np.mean(found, 0)
    return {"low": float(low), "high": float(high)}


def reproduce(profile: str, report=print) -> None:
    """Simulate the test, hard and empty sequences, estimate both modalities, keep errors and tables.

    Each recording and each sequence's results are kept as soon as they are done, under a fingerprint of
    what made them, so that an interrupted run goes on and a second run has nothing to do.
    """
    folder, mark = DERIVED / profile, fingerprint(profile)
    folder.mkdir(parents=True, exist_ok=True)
    for name in SEQUENCES:
        done = folder / f"{name}.done"
        if done.exists() and done.read_text() == mark:
            report(f"{name}: up to date")
            continue
        recording = _recorded(name, sequences.SECONDS[profile][name.split("-")[0]], folder, report)
        for gap in DOMAIN_GAPS if name.startswith("test") else DOMAIN_GAPS[:1]:
            for modality in MODALITIES:
                _estimate(recording, modality, gap, folder, profile, report)
        if name.startswith("test"):
            fits = pd.concat([filter_quality(recording, gap) for gap in shipped_gaps()])
            save_table(folder / f"filters-{name}.csv", fits, profile=profile)
        if recording.truth is not None:
            values = saturation(recording, Port.lm_map())
            save_json(folder / f"saturation-{name}.json", values, profile=profile)
        done.write_text(mark)
    tables = [
        pd.read_csv(folder / f"summary-{_label(f'test-{light}', modality, gap)}.csv").assign(
            light=light, modality=modality, training=f"{gap}-domain-gap"
        )
        for light in LIGHTS for modality in MODALITIES for gap in DOMAIN_GAPS
    ]  # fmt: skip
    save_table(folder / "summary.csv", pd.concat(tables), profile=profile)


def _recorded(name: str, seconds: float, folder: Path, report) -> Recording:
    """The sequence's recording, simulated unless the one kept is of the same bench and length."""
    path, made_of = folder / f"{name}.npz", folder / f"{name}.simulated"
    mark = fingerprint(name, str(seconds), patterns=BENCH)
    if not (path.exists() and made_of.exists() and made_of.read_text() == mark):
        report(f"{name}: simulating {seconds:.0f} s")
        write_npz(sequences.simulate(name, seconds), path)
        made_of.write_text(mark)
    return open_recording(path)


def _label(name: str, modality: str, gap: str) -> str:
    """Low-domain-gap weights are the default, and go without saying."""
    return f"{name}-{modality}" + ("-high-gap" if gap == "high" else "")


def _estimate(recording: Recording, modality: str, gap: str, folder: Path, profile: str, report) -> None:
    port, label = Port.lm_map(), _label(recording.name, modality, gap)
    estimator = Estimator(recording.camera, port, modality, gap)
    found = list(estimate(recording, estimator, estimator.settings.rate_hz))
    write_estimates(found, folder / f"estimates-{label}.csv")
    counts = {
        "images": len(found),
        "poses": sum(e.T_cam_port is not None for e in found),
        "ellipses": sum(e.ellipse is not None for e in found),
    }
    report(f"{label}: {counts['poses']} poses in {counts['images']} images")
    save_json(folder / f"counts-{label}.json", counts, profile=profile)
    if recording.truth is not None:
        table = errors(recording, found, port)
        save_table(folder / f"errors-{label}.csv", table, profile=profile)
        save_table(folder / f"summary-{label}.csv", summary(table), profile=profile)


def compare(folder: Path) -> pd.DataFrame:
    """The paper's Table I beside ours, cell by cell; ``printed`` is the paper's formula on our ellipses."""
    keys = ["training", "outlier_filter", "metric", "statistic", "light", "modality"]
    paper = pd.read_csv(DATA / "paper" / "table1.csv")
    ours = pd.read_csv(folder / "summary.csv").pivot_table("value", keys, "formula", dropna=False)
    ours = ours.rename(columns={"exact": "ours", "paper": "printed"}).reset_index()
    return paper.rename(columns={"value": "published"}).merge(ours, on=keys)
