"""Statistics of many images' errors besides the medians of `table1.summary`.

They say how errors are distributed, whether covariances hold what they predict, and whether fusion helps.
``tables`` are always `error_table.errors` of sequences that count as one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from scipy.stats import chi2

from lmmap.evaluation.error_table import METRICS, detected_in_view_percent
from lmmap.settings import MODALITIES

from . import bootstrap
from .table1 import bootstrap_counts

WRONG_DEG = {"normal_error_deg": 5.0, "rotation_error_deg": 20.0}  # another ellipse; gaps taken for markers


def coverage(tables: Sequence[pd.DataFrame], draws: int, seed: int = 0) -> dict:
    """Percent of poses whose 95 % region holds the true pose.

    Returns
    -------
    dict
        ``poses``, their number; ``inside_95_percent``, with its 95 % interval from ``low`` to ``high``;
        ``wrong_percent``, of poses whose region misses the true pose by an error above `WRONG_DEG`.
    """
    table = pd.concat(tables, ignore_index=True)
    known, inside = table.nees.notna(), table.nees < chi2.ppf(0.95, 6)
    wrong = ~inside & np.any([table[metric] > limit for metric, limit in WRONG_DEG.items()], axis=0)
    each_once, counts = np.ones((1, len(table)), int), bootstrap_counts([len(t) for t in tables], draws, seed)
    inside_percent = 100 * bootstrap.shares(inside, known, each_once)[0]
    wrong_percent = 100 * bootstrap.shares(wrong, known, each_once)[0]
    lower, upper = bootstrap.interval(100 * bootstrap.shares(inside, known, counts))
    return {"poses": int(known.sum()), "inside_95_percent": inside_percent, "low": lower, "high": upper,
            "wrong_percent": wrong_percent}  # fmt: skip


def sequence_summary(table: pd.DataFrame) -> dict:
    """Detection rate with the ring in view, median errors and `coverage` of one sequence's errors."""
    inside_percent = coverage([table], draws=0)["inside_95_percent"]
    return {"found_percent": detected_in_view_percent(table), **table[list(METRICS)].median(),
            "inside_95_percent": inside_percent}  # fmt: skip


def by_view(tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Root mean squares of `METRICS`, and the number of ``poses``, by whether the whole ring is in view."""
    poses = pd.concat(tables).dropna(subset=METRICS[0])
    rows = []
    for in_view, view in poses.groupby("in_view"):
        each_once = np.ones((1, len(view)), int)
        errors = {metric: bootstrap.root_mean_squares(view[metric], each_once)[0] for metric in METRICS}
        rows.append({"in_view": in_view, **errors, "poses": len(view)})
    return pd.DataFrame(rows, columns=["in_view", *METRICS, "poses"])


def distribution(tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Quantiles of errors: ``percent`` (0 to 100), and a column per error.

    The columns are `METRICS` of our poses, the same of the printed formula's (``paper_``), and ``nees``; a
    column is NaN where no image has such an error.
    """
    columns = [*METRICS, *(f"paper_{metric}" for metric in METRICS), "nees"]
    percent = np.arange(101)
    quantiles = pd.concat(tables)[columns].quantile(percent / 100).reset_index(drop=True)
    return quantiles.assign(percent=percent)[["percent", *columns]]


def answers(tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Number of images with the whole ring in view (``in_view``) by the estimate's ``status``."""
    counts = pd.concat(tables).query("in_view").status.value_counts().sort_index()
    return counts.rename("in_view").reset_index()


def promise(tables: Sequence[pd.DataFrame], groups: int = 10) -> pd.DataFrame:
    """Predicted and actual errors of poses, in ``groups`` of equal size by the predicted one.

    Returns
    -------
    DataFrame
        ``what`` (``position_m`` or ``normal_deg``), ``group``, the median ``predicted`` standard deviation
        along the worst direction, the median ``error``, and the 95 % quantile of the errors, ``most``.
    """
    table, rows = pd.concat(tables), []
    for what, predicted, error in (
        ("position_m", "position_sigma_m", "position_error_m"),
        ("normal_deg", "normal_sigma_deg", "normal_error_deg"),
    ):
        pairs = table[[predicted, error]].dropna().sort_values(predicted)
        for group, members in enumerate(np.array_split(pairs.to_numpy(), groups)):
            if len(members):
                rows.append((what, group, *np.median(members, axis=0), np.quantile(members[:, 1], 0.95)))
    return pd.DataFrame(rows, columns=["what", "group", "predicted", "error", "most"])


def median_difference(first: Sequence[pd.DataFrame], second: Sequence[pd.DataFrame], metric: str, draws: int,
                      seed: int = 0) -> dict:  # fmt: skip
    """Median of ``metric`` in ``first`` less that in ``second``, over images of nearly the same time (50 ms).

    Returns
    -------
    dict
        ``difference``, its 95 % interval from ``low`` to ``high``, and the number of ``images``.
    """
    known = [[t[["t_us", metric]].dropna() for t in tables] for tables in (first, second)]
    pairs = [pd.merge_asof(*pair, on="t_us", direction="nearest", tolerance=50_000).dropna()
             for pair in zip(*known, strict=True)]  # fmt: skip
    both = pd.concat(pairs)
    counts = bootstrap_counts([len(pair) for pair in pairs if len(pair)], draws, seed)
    a, b = both[f"{metric}_x"], both[f"{metric}_y"]
    lower, upper = bootstrap.interval(bootstrap.medians(a, counts) - bootstrap.medians(b, counts))
    return {"difference": a.median() - b.median(), "low": lower, "high": upper, "images": len(both)}


def against_better(tables: Mapping[str, Sequence[pd.DataFrame]], draws: int, seed: int = 0) -> pd.DataFrame:
    """`median_difference` of the fused track and the better camera, by ``metric``.

    The better camera, ``better``, is the one with the smaller median.

    Parameters
    ----------
    tables : errors of the same sequences, by modality and of ``fused``
    """
    rows = []
    for metric in METRICS:
        medians = {m: pd.concat(tables[m])[metric].median() for m in MODALITIES}
        better = min(medians, key=medians.get)
        difference = median_difference(tables["fused"], tables[better], metric, draws, seed)
        rows.append({"metric": metric, "better": better, **difference})
    return pd.DataFrame(rows)
