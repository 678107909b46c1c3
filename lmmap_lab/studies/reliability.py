"""Whether a confidence is a probability: of poses with a confidence of 0.8, eight in ten should be right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.stats import binomtest

from lmmap.evaluation.error_table import METRICS, error_values, is_wrong
from lmmap.evaluation.pose_errors import true_poses
from lmmap.types import Estimate, Port, Recording

BINS = np.array([0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 1.0])  # most poses are in the last
SURE = 0.95  # a pose with more is hardly ever wrong


def confidences(recording: Recording, estimates: list[Estimate], port: Port) -> pd.DataFrame:
    """``t_us`` and ``confidence`` of each image within the time of the truth, and whether its pose, reported
    or doubtful, is ``right``: 1 or 0, NaN without a pose."""
    estimates, truth = true_poses(recording, estimates)
    every = [replace(e, T_cam_port=e.T_cam_port or e.doubtful) for e in estimates]
    table = pd.DataFrame(error_values(every, truth, port), columns=list(METRICS))
    right = (~pd.Series(is_wrong(table))).where(table[METRICS[0]].notna()).astype(float)
    return pd.DataFrame({"t_us": [e.t_us for e in estimates], "confidence": [e.confidence for e in estimates],
                         "right": right})  # fmt: skip


def reliability(confidence: np.ndarray, right: np.ndarray) -> pd.DataFrame:
    """By bin of the confidence: poses, their mean confidence, and the share of them that is right.

    Parameters
    ----------
    confidence : (N,)
        Of each pose, in [0, 1].
    right : (N,)
        Whether the pose is right.
    """
    index = np.clip(np.digitize(confidence, BINS) - 1, 0, len(BINS) - 2)
    table = pd.DataFrame({"bin": BINS[index], "confidence": confidence, "right": right})
    groups = table.groupby("bin")
    return groups[["confidence", "right"]].mean().assign(poses=groups.size()).reset_index()


def calibration_error(table: pd.DataFrame) -> float:
    """Expected calibration error of `reliability`'s table: the mean over poses of how far their bin's share
    lies from its confidence (Naeini et al. 2015)."""
    return float(np.average(np.abs(table.confidence - table.right), weights=table.poses))


def error_by_chance(table: pd.DataFrame, draws: int = 2000, seed: int = 0) -> tuple[float, float]:
    """Calibration errors of a confidence that is a probability, of as many poses: their mean, and the error
    that one in twenty exceeds.

    Of few poses even a perfect confidence has an error, for a bin of five cannot be right in 93 %.
    """
    rng, confidence = np.random.default_rng(seed), table.confidence.to_numpy()
    shares = rng.binomial(table.poses, confidence, (draws, len(table))) / table.poses.to_numpy()
    errors = np.average(np.abs(shares - confidence), weights=table.poses, axis=1)
    return float(errors.mean()), float(np.quantile(errors, 0.95))


def pooled(table: pd.DataFrame) -> pd.DataFrame:
    """One table of `reliability`'s of several sets, whose poses count alike."""
    sums = table[["confidence", "right"]].mul(table.poses, axis=0).assign(poses=table.poses)
    sums = sums.groupby(table.bin).sum()
    means = sums[["confidence", "right"]].div(sums.poses, axis=0)
    return means.assign(poses=sums.poses).reset_index()


def share_intervals(table: pd.DataFrame) -> np.ndarray:
    """Ends (N, 2) of the 95 % interval of each bin's share of right poses (Wilson 1927)."""
    counts = np.rint(table.right * table.poses).astype(int)
    return np.array([share_interval(*of_bin) for of_bin in zip(counts, table.poses, strict=True)])


def share_interval(count: int, total: int) -> tuple[float, float]:
    """Ends of the 95 % interval of a share (Wilson 1927)."""
    return tuple(binomtest(int(count), int(total)).proportion_ci(method="wilson"))


def joined(errors: Sequence[pd.DataFrame], confidences: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """One table of the images of sequences: `error_table.errors` of each, and `confidences` beside them."""
    pairs = zip(errors, confidences, strict=True)
    return pd.concat(e.merge(c, on="t_us", validate="one_to_one") for e, c in pairs)


def of_sequences(errors: Sequence[pd.DataFrame], confidences: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """`reliability` of the poses of sequences, with the ring in view.

    Parameters
    ----------
    errors
        `error_table.errors` of each sequence.
    confidences
        `confidences` of each.

    Returns
    -------
    DataFrame
        With ``calibration_error``, and ``sure_wrong_percent``: how many of the poses with a confidence over
        `SURE` are wrong.
    """
    table = joined(errors, confidences)
    poses = table[table.in_view & table.position_error_m.notna()]
    right, confidence = ~is_wrong(poses), poses.confidence.to_numpy()
    bins = reliability(confidence, right)
    wrong_percent = 100 * pd.Series(~right)[confidence > SURE].mean()
    return bins.assign(calibration_error=calibration_error(bins), sure_wrong_percent=wrong_percent)
