"""Errors of a recording's estimates against its truth, one row each, and a summary of them."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np
import pandas as pd

from ..geometry.port import in_view
from ..settings import OURS, Settings
from ..tracking.outliers import outlier_filter
from ..tracking.within_limits import is_certain, sigmas
from ..types import AnyRecording, Estimate, Port, Pose
from .pose_errors import normal_error_rad, pose_difference, position_error_m, rotation_error_rad, true_poses

METRICS = ("position_error_m", "normal_error_deg", "rotation_error_deg")
PREDICTIONS = ["position_sigma_m", "normal_sigma_deg", "nees"]


def errors(recording: AnyRecording, estimates: list[Estimate], port: Port) -> pd.DataFrame:
    """Errors of the estimates at times that the recording's truth covers, one row each.

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
        table[[prefix + metric for metric in METRICS]] = error_values(variant, truth, port)
    table[PREDICTIONS] = _predictions(estimates, truth, port)
    return table


def error_values(estimates: list[Estimate], truth: Pose, port: Port) -> np.ndarray:
    """`METRICS` (N, 3) of estimates; rows without a pose are NaN."""
    values = np.full((len(estimates), len(METRICS)), np.nan)
    has_pose = np.array([e.T_cam_port is not None for e in estimates], bool)
    poses, truth = Pose.stack([T for e in estimates if (T := e.T_cam_port) is not None]), truth[has_pose]
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
        poses = Pose.stack([cast(Pose, e.T_cam_port) for e in predicted])
        differences = pose_difference(poses, truth[has_both], port.yaw_period_rad)
        nees = [
            d @ np.linalg.solve(cast(np.ndarray, e.covariance), d)
            for d, e in zip(differences, predicted, strict=True)
        ]
        deviations = np.array([sigmas(e) for e in predicted]) * [1, 180 / np.pi]
        values[has_both] = np.column_stack([deviations, nees])
    return values


def is_wrong(table: pd.DataFrame, prefix: str = "", settings: Settings = OURS) -> np.ndarray:
    """Which poses of `errors` are too far off to dock with, (N,); a missing pose is not wrong."""
    limits = {
        "position_error_m": settings.right_position_m,
        "normal_error_deg": np.rad2deg(settings.right_normal_rad),
        "rotation_error_deg": np.rad2deg(settings.right_rotation_rad),
    }
    return np.any([table[prefix + metric] > limit for metric, limit in limits.items()], axis=0)


def report(table: pd.DataFrame, without_truth: int = 0) -> dict:
    """The numbers that `lmmap evaluate` prints, without outlier filter.

    ``paper_formula`` marks poses from the formula as printed in the paper.
    """
    detected = table.position_error_m.notna()
    return {
        "images": len(table),
        "images_without_truth": without_truth,
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
    """Percentage of the images of `errors` with the whole ring in view that have a pose; NaN if none is."""
    return _percent_true(table.position_error_m.notna()[table.in_view])


def _percent_true(flags: pd.Series) -> float:
    return 100 * flags.sum() / len(flags) if len(flags) else np.nan
