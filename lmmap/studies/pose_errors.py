"""The paper's accuracy study: errors, detection rates and intervals of recordings, and the paper's table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from ..bench import labels, photometry, sequences
from ..geometry.port import in_view
from ..pipeline.run import true_poses
from ..provenance import DATA
from ..recordings.pose_files import stacked
from ..settings import PAPER
from ..tracking.outliers import certain, outlier_filter, sigmas
from ..types import Estimate, Port, Recording
from . import bootstrap
from .metrics import normal_error_rad, pose_difference, position_error_m, rotation_error_rad

LIGHTS, MODALITIES, DOMAIN_GAPS = ("low", "medium", "high"), ("rgb", "event"), ("low", "high")
TRACKS = (*MODALITIES, "fused")  # whose estimates are judged
METRICS = ("position_error_m", "normal_error_deg", "rotation_error_deg")
VARIANTS = {  # prefix of the errors' columns, who is taken at all, whom the outlier filter keeps
    "exact": ("", None, "kept"),
    "printed": ("paper_", None, "paper_kept"),
    "certain": ("", "certain", "certain_kept"),
}
BLOCK_S = 5.0  # of the bootstrap: a quarter of the test motion's mean period, after which the view is another


def errors(recording: Recording, estimates: list[Estimate], port: Port) -> pd.DataFrame:
    """One row per estimate, NaN where there is no pose.

    Returns
    -------
    DataFrame
        ``t_us, status, in_view``; errors of our pose and of the paper's formula (``paper_``) on the same
        ellipse; whom the outlier filter keeps of either (``kept, paper_kept``); ``certain``, and whom it
        keeps of those; what the covariance promises (``position_sigma_m, normal_sigma_deg``), and the
        squared Mahalanobis distance of the true pose (``nees``, chi-square with 6 degrees of freedom).
    """
    known, truth = true_poses(recording, estimates)
    printed = [replace(e, T_cam_port=e.paper) for e in known]
    table = pd.DataFrame({"t_us": [e.t_us for e in known], "status": [str(e.status) for e in known]})
    table["in_view"] = in_view(truth, port, recording.camera)
    table["certain"] = sure = certain([e if e.covariance is not None else replace(e, T_cam_port=None)
                                       for e in known])  # fmt: skip
    sure_ones = [e if s else replace(e, T_cam_port=None) for e, s in zip(known, sure, strict=True)]
    for name, some in (("kept", known), ("paper_kept", printed), ("certain_kept", sure_ones)):
        table[name] = outlier_filter(some, port.yaw_period_rad)
    for prefix, some in (("", known), ("paper_", printed)):
        found = np.array([e.T_cam_port is not None for e in some], bool)
        ours = stacked([e.T_cam_port for e in some if e.T_cam_port is not None])
        values = (position_error_m(ours, truth[found]), np.rad2deg(normal_error_rad(ours, truth[found])),
                  np.rad2deg(rotation_error_rad(ours, truth[found], port.yaw_period_rad)))  # fmt: skip
        for metric, value in zip(METRICS, values, strict=True):
            table[prefix + metric] = np.nan
            table.loc[found, prefix + metric] = value
    promised = ["position_sigma_m", "normal_sigma_deg", "nees"]
    table[promised] = np.nan
    having = np.array([e.T_cam_port is not None and e.covariance is not None for e in known], bool)
    if having.any():
        some = [e for e, has in zip(known, having, strict=True) if has]
        d = pose_difference(stacked([e.T_cam_port for e in some]), truth[having], port.yaw_period_rad)
        nees = [x @ np.linalg.solve(e.covariance, x) for x, e in zip(d, some, strict=True)]
        table.loc[having, promised] = np.column_stack(
            [np.array([sigmas(e) for e in some]) * [1, 180 / np.pi], nees]
        )
    return table


def summary(tables: pd.DataFrame | Sequence[pd.DataFrame], draws: int = 0, seed: int = 0,
            rate_hz: float = PAPER.rate_hz) -> pd.DataFrame:  # fmt: skip
    """Median and RMSE of each error and the detection rates, by `VARIANTS`, with and without outlier filter.

    Parameters
    ----------
    tables
        `errors` of one sequence, or of several that count as one.
    draws
        Of the bootstrap for the 95 % intervals ``low`` and ``high``; 0 leaves them NaN.
    rate_hz
        Of the estimates.
    """
    tables = [tables] if isinstance(tables, pd.DataFrame) else list(tables)
    table = pd.concat(tables, ignore_index=True)
    counts = drawn_counts([len(t) for t in tables], draws, seed, rate_hz)
    once, rows = np.ones((1, len(table)), int), []

    def row(name, statistic, function, *values):
        value, drawn = function(*values, once)[0], function(*values, counts)
        rows.append((*name, statistic, value, *bootstrap.interval(drawn)))

    for (variant, (prefix, among, kept)), filtered in product(VARIANTS.items(), ("without", "with")):
        found = table[prefix + METRICS[0]].notna() & (table[among] if among else True)
        found &= table[kept] if filtered == "with" else True
        for metric in METRICS:
            values = table[prefix + metric].where(found)
            row((filtered, metric, variant), "median", bootstrap.medians, values)
            row((filtered, metric, variant), "rmse", bootstrap.root_mean_squares, values)
        for statistic, among_which in (("all", table.in_view | True), ("in_fov", table.in_view)):
            name = (filtered, "detection_rate_percent", variant)
            row(name, statistic, _percents, found, among_which)
    return pd.DataFrame(
        rows, columns=["outlier_filter", "metric", "variant", "statistic", "value", "low", "high"]
    )


def drawn_counts(lengths: Sequence[int], draws: int, seed: int, rate_hz: float = PAPER.rate_hz) -> np.ndarray:
    """`resampling.block_counts` with blocks of `BLOCK_S`, of sequences of so many images at a rate."""
    return bootstrap.block_counts(lengths, round(BLOCK_S * rate_hz), draws, np.random.default_rng(seed))


def _percents(found, among, counts):
    return 100 * bootstrap.shares(found, among, counts)


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


def saturation(recording: Recording, port: Port, rate_hz: float = PAPER.rate_hz) -> pd.DataFrame:
    """Percent of the port's region of interest that is black (``low``) and white (``high``), by frame at a
    rate: ``t_us, low, high``."""
    rows, every = [], max(round(sequences.FRAME_HZ / rate_hz), 1)
    times_us = recording.frames_t_us[::every]
    frames = zip(times_us.tolist(), recording.truth.at(times_us), recording.frames[::every], strict=True)
    for t_us, pose, frame in frames:
        region = labels.label_masks(pose, port, recording.camera).any(0)
        if region.any():
            rows.append((t_us, *photometry.roi_saturation_percent(frame, region)))
    return pd.DataFrame(rows, columns=["t_us", "low", "high"])


def compare(folder: Path) -> pd.DataFrame:
    """The paper's Table I beside ours, cell by cell.

    Returns
    -------
    DataFrame
        A row per cell of the paper's table.  ``table1``; ``printed``, the paper's formula on our ellipses;
        ``ours``, the exact and refined pose; ``certain``, ours where its covariance is small; ``fused`` of
        both modalities, alike for both.  Of ours, ``_low`` and ``_high`` bound the 95 % interval.
    """
    cell = ["training", "outlier_filter", "metric", "statistic", "light"]
    paper = pd.read_csv(DATA / "paper" / "table1.csv").rename(columns={"value": "table1"})
    every = pd.read_csv(folder / "summary.csv")
    names = {"printed": "printed", "exact": "ours", "certain": "certain", "fused": "fused"}
    for variant, name in names.items():
        ends = {"value": name, "low": f"{name}_low", "high": f"{name}_high"}
        of = every[every.variant == variant].rename(columns=ends)
        how = "inner" if variant in ("printed", "exact") else "left"  # the others are not in every study
        keys = cell if variant == "fused" else [*cell, "modality"]
        paper = paper.merge(of[[*keys, *ends.values()]], on=keys, how=how)
    return paper
