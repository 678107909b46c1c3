"""Errors, detection rates and intervals of recordings, and the paper's Table I beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd

from lmmap.geometry.port import in_view
from lmmap.pipeline.run import true_poses
from lmmap.recordings.pose_files import stack_poses
from lmmap.settings import PAPER
from lmmap.tracking.outliers import is_certain, outlier_filter, sigmas
from lmmap.types import Estimate, Port, Pose, Recording

from ..bench import labels, photometry, sequences
from ..provenance import DATA
from . import bootstrap
from .metrics import (
    normal_error_rad,
    pose_difference,
    position_error_m,
    rotation_error_rad,
)
from .right_and_wrong import is_wrong

LIGHTS, MODALITIES, DOMAIN_GAPS = ("low", "medium", "high"), ("rgb", "event"), ("low", "high")
TRACKS = (*MODALITIES, "fused")  # the estimates that are judged
METRICS = ("position_error_m", "normal_error_deg", "rotation_error_deg")
PREDICTIONS = ["position_sigma_m", "normal_sigma_deg", "nees"]
VARIANTS = {  # prefix of the errors' columns, column that selects poses, column of those that are kept
    "exact": ("", None, "kept"),
    "printed": ("paper_", None, "paper_kept"),
    "certain": ("", "certain", "certain_kept"),
}
COMPARED = {"as printed": "as_printed", "printed": "printed", "exact": "ours", "certain": "certain",
            "fused": "fused"}  # fmt: skip
BLOCK_S = 5.0  # of the bootstrap: a quarter of the test motion's mean period, after which the view is another


def errors(recording: Recording, estimates: list[Estimate], port: Port) -> pd.DataFrame:
    """Errors of the estimates within the time of the recording's truth, one row each.

    Returns
    -------
    DataFrame
        ``t_us, status, in_view``, the last for images that show the whole ring.  `METRICS` of our pose and,
        with the prefix ``paper_``, of the pose by the printed formula on the same ellipse; NaN where there is
        no pose.  ``kept`` and ``paper_kept``: whether the outlier filter keeps the pose; ``certain`` and
        ``certain_kept``: whether the covariance is small, and the filter keeps the pose among those.
        `PREDICTIONS`: the covariance's standard deviations, and the squared Mahalanobis distance of the true
        pose (chi-square with 6 degrees of freedom).
    """
    estimates, truth = true_poses(recording, estimates)
    printed = [replace(e, T_cam_port=e.printed) for e in estimates]
    with_covariance = [e if e.covariance is not None else replace(e, T_cam_port=None) for e in estimates]
    certain = is_certain(with_covariance)
    pairs = zip(estimates, certain, strict=True)
    certain_only = [e if keep else replace(e, T_cam_port=None) for e, keep in pairs]
    table = pd.DataFrame({"t_us": [e.t_us for e in estimates], "status": [str(e.status) for e in estimates]})
    table["in_view"], table["certain"] = in_view(truth, port, recording.camera), certain
    variants = {"kept": estimates, "paper_kept": printed, "certain_kept": certain_only}
    for column, variant in variants.items():
        table[column] = outlier_filter(variant, port.yaw_period_rad)
    for prefix, variant in (("", estimates), ("paper_", printed)):
        table[[prefix + metric for metric in METRICS]] = _error_values(variant, truth, port)
    table[PREDICTIONS] = _predictions(estimates, truth, port)
    return table


def confidences(recording: Recording, estimates: list[Estimate], port: Port) -> pd.DataFrame:
    """``t_us`` and ``confidence`` of each image within the time of the truth, and whether its pose, reported
    or doubtful, is ``right``: 1 or 0, NaN without a pose."""
    estimates, truth = true_poses(recording, estimates)
    every = [replace(e, T_cam_port=e.T_cam_port or e.doubtful) for e in estimates]
    table = pd.DataFrame(_error_values(every, truth, port), columns=list(METRICS))
    right = (~pd.Series(is_wrong(table))).where(table[METRICS[0]].notna()).astype(float)
    return pd.DataFrame({"t_us": [e.t_us for e in estimates], "confidence": [e.confidence for e in estimates],
                         "right": right})  # fmt: skip


def _error_values(estimates: list[Estimate], truth: Pose, port: Port) -> np.ndarray:
    """`METRICS` (N, 3) of estimates; rows without a pose are NaN."""
    values = np.full((len(estimates), len(METRICS)), np.nan)
    has_pose = np.array([e.T_cam_port is not None for e in estimates], bool)
    poses, truth = stack_poses([e.T_cam_port for e in estimates if e.T_cam_port is not None]), truth[has_pose]
    values[has_pose] = np.column_stack([
        position_error_m(poses, truth), np.rad2deg(normal_error_rad(poses, truth)),
        np.rad2deg(rotation_error_rad(poses, truth, port.yaw_period_rad)),
    ])  # fmt: skip
    return values


def _predictions(estimates: list[Estimate], truth: Pose, port: Port) -> np.ndarray:
    """`PREDICTIONS` (N, 3) of estimates; rows without a covariance are NaN."""
    values = np.full((len(estimates), len(PREDICTIONS)), np.nan)
    has_both = np.array([e.T_cam_port is not None and e.covariance is not None for e in estimates], bool)
    predicted = [e for e, has in zip(estimates, has_both, strict=True) if has]
    if predicted:
        poses = stack_poses([e.T_cam_port for e in predicted])
        differences = pose_difference(poses, truth[has_both], port.yaw_period_rad)
        nees = [d @ np.linalg.solve(e.covariance, d) for d, e in zip(differences, predicted, strict=True)]
        deviations = np.array([sigmas(e) for e in predicted]) * [1, 180 / np.pi]
        values[has_both] = np.column_stack([deviations, nees])
    return values


def summary(
    tables: pd.DataFrame | Sequence[pd.DataFrame],
    draws: int = 0,
    seed: int = 0,
    rate_hz: float = PAPER.rate_hz,
    variants: Mapping[str, tuple] = VARIANTS,
) -> pd.DataFrame:
    """Median and RMSE of each error, detection rates and the share of wrong poses (`is_wrong`) among images
    with the whole ring in view, by ``variants``, with and without outlier filter.

    Parameters
    ----------
    tables
        `errors` of one sequence, or of several that count as one.
    draws
        Draws of the bootstrap; with 0 the intervals are NaN.
    rate_hz
        The estimates' rate.

    Returns
    -------
    DataFrame
        ``outlier_filter, metric, variant, statistic, value``, and the 95 % interval's ends ``low, high``.
    """
    tables = [tables] if isinstance(tables, pd.DataFrame) else list(tables)
    table = pd.concat(tables, ignore_index=True)
    counts = bootstrap_counts([len(t) for t in tables], draws, seed, rate_hz)
    each_once, rows = np.ones((1, len(table)), int), []

    def row(name, statistic, function, *values):
        value, samples = function(*values, each_once)[0], function(*values, counts)
        rows.append((*name, statistic, value, *bootstrap.interval(samples)))

    for (variant, (prefix, selection, kept)), filtered in product(variants.items(), ("without", "with")):
        detected = table[prefix + METRICS[0]].notna() & (table[selection] if selection else True)
        detected &= table[kept] if filtered == "with" else True
        for metric in METRICS:
            values = table[prefix + metric].where(detected)
            row((filtered, metric, variant), "median", bootstrap.medians, values)
            row((filtered, metric, variant), "rmse", bootstrap.root_mean_squares, values)
        for statistic, images in (("all", table.in_view | True), ("in_fov", table.in_view)):
            name = (filtered, "detection_rate_percent", variant)
            row(name, statistic, _percents, detected, images)
        wrong = detected & is_wrong(table, prefix)
        row((filtered, "wrong_percent", variant), "in_fov", _percents, wrong, table.in_view)
    return pd.DataFrame(
        rows, columns=["outlier_filter", "metric", "variant", "statistic", "value", "low", "high"]
    )


def bootstrap_counts(
    lengths: Sequence[int], draws: int, seed: int, rate_hz: float = PAPER.rate_hz
) -> np.ndarray:
    """`bootstrap.block_counts` with blocks of `BLOCK_S`, for sequences of ``lengths`` images at a rate."""
    return bootstrap.block_counts(lengths, round(BLOCK_S * rate_hz), draws, np.random.default_rng(seed))


def _percents(members, images, counts):
    return 100 * bootstrap.shares(members, images, counts)


def report(table: pd.DataFrame) -> dict:
    """The numbers that `lmmap evaluate` prints, without outlier filter.

    ``paper_formula`` stands for poses by the formula as it is printed in the paper.
    """
    detected = table.position_error_m.notna()
    return {
        "images": len(table),
        "images_with_ring_in_view": int(table.in_view.sum()),
        "detected_of_all_percent": _percent_true(detected),
        "detected_of_in_view_percent": detected_in_view_percent(table),
        "position_error_median_mm": 1e3 * table.position_error_m.median(),
        "normal_error_median_deg": table.normal_error_deg.median(),
        "rotation_error_median_deg": table.rotation_error_deg.median(),
        "paper_formula_position_median_mm": 1e3 * table.paper_position_error_m.median(),
        "paper_formula_normal_median_deg": table.paper_normal_error_deg.median(),
        "paper_formula_rotation_median_deg": table.paper_rotation_error_deg.median(),
    }


def detected_in_view_percent(table: pd.DataFrame) -> float:
    """Percent of the images of `errors` with the whole ring in view that have a pose; NaN of no image."""
    return _percent_true(table.position_error_m.notna()[table.in_view])


def _percent_true(flags: pd.Series) -> float:
    return 100 * flags.sum() / len(flags) if len(flags) else np.nan


def saturation(recording: Recording, port: Port, rate_hz: float = PAPER.rate_hz) -> pd.DataFrame:
    """Percent of the port's region of interest that is black and white, in frames at a rate.

    Returns
    -------
    DataFrame
        ``t_us, low, high``: the time, the share of black pixels, the share of white pixels.
    """
    rows, every = [], max(round(sequences.FRAME_HZ / rate_hz), 1)
    times_us = recording.frames_t_us[::every]
    frames = zip(times_us.tolist(), recording.truth.at(times_us), recording.frames[::every], strict=True)
    for t_us, pose, frame in frames:
        region = labels.label_masks(pose, port, recording.camera).any(0)
        if region.any():
            rows.append((t_us, *photometry.roi_saturation_percent(frame, region)))
    return pd.DataFrame(rows, columns=["t_us", "low", "high"])


def compare(folder: Path) -> pd.DataFrame:
    """The paper's Table I and our ``summary.csv`` of a folder, cell by cell.

    Returns
    -------
    DataFrame
        A row per cell of the paper's table, and of the share of wrong poses, which the paper does not state.
        ``table1``: the paper's value; ``as_printed``: that of its whole procedure on our bench; ``printed``:
        that of its formula on our ellipses; ``ours``: that of the exact and refined pose; ``certain``: the
        same where the covariance is small; ``fused``: that of both modalities together, equal for both.  All
        but the first have their 95 % interval in columns with ``_low`` and ``_high`` appended.
    """
    cell = ["training", "outlier_filter", "metric", "statistic", "light"]
    compared = pd.read_csv(DATA / "paper" / "table1.csv").rename(columns={"value": "table1"})
    rates = compared[(compared.metric == "detection_rate_percent") & (compared.statistic == "in_fov")]
    compared = pd.concat([compared, rates.assign(metric="wrong_percent", table1=np.nan)], ignore_index=True)
    summaries = pd.read_csv(folder / "summary.csv")
    if (folder / "ladder.csv").exists():
        rungs = pd.read_csv(folder / "ladder.csv").rename(columns={"rung": "variant"})
        summaries = pd.concat([summaries, rungs[rungs.variant == "as printed"]])
    for variant, name in COMPARED.items():
        ends = {"value": name, "low": f"{name}_low", "high": f"{name}_high"}
        cells = summaries[summaries.variant == variant].rename(columns=ends)
        how = "inner" if variant in ("printed", "exact") else "left"  # the others are not in every study
        keys = cell if variant == "fused" else [*cell, "modality"]
        compared = compared.merge(cells[[*keys, *ends.values()]], on=keys, how=how)
    return compared
