"""What else `accuracy.errors` of many images say: how they are distributed, whether the covariances held what
they promised, and whether fusion helped."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from scipy.stats import chi2

from . import bootstrap
from .pose_errors import METRICS, MODALITIES, drawn_counts

WRONG_DEG = {"normal_error_deg": 5.0, "rotation_error_deg": 20.0}  # another ellipse; gaps taken for markers


def coverage(tables: Sequence[pd.DataFrame], draws: int, seed: int = 0) -> dict:
    """Percent of `errors`' poses whose 95 % region holds the true pose, with its 95 % interval; and of those
    that are outside and wrong by `WRONG_DEG`, ``wrong_percent``."""
    table = pd.concat(tables, ignore_index=True)
    known, inside = table.nees.notna(), table.nees < chi2.ppf(0.95, 6)
    wrong = ~inside & np.any([table[metric] > limit for metric, limit in WRONG_DEG.items()], axis=0)
    once, counts = np.ones((1, len(table)), int), drawn_counts([len(t) for t in tables], draws, seed)
    inside_percent, wrong_percent = (100 * bootstrap.shares(some, known, once)[0] for some in (inside, wrong))
    low, high = bootstrap.interval(100 * bootstrap.shares(inside, known, counts))
    return {"poses": int(known.sum()), "inside_95_percent": inside_percent, "low": low, "high": high,
            "wrong_percent": wrong_percent}  # fmt: skip


def of_sequence(table: pd.DataFrame) -> dict:
    """Of one sequence's `errors`: percent of the images with the ring in view that have a pose, the medians,
    and percent of poses whose 95 % region holds the true one."""
    found = table.position_error_m.notna()[table.in_view]
    inside = coverage([table], draws=0)["inside_95_percent"]
    return {"found_percent": 100 * found.mean(), **table[list(METRICS)].median(), "inside_95_percent": inside}


def by_view(tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Root mean squares of `errors`' poses, and their number ``poses``, by ``in_view``: whether the image has
    the whole ring."""
    found = pd.concat(tables).dropna(subset=METRICS[0])
    views = found.groupby("in_view")[list(METRICS)]
    squares = views.agg(lambda error: np.sqrt((error**2).mean()))
    return squares.assign(poses=views.size()).reset_index()


def distribution(tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Quantiles of `errors`' poses: ``percent`` (0 to 100), a column per error, per error of the printed
    formula (``paper_``), and of ``nees``; NaN where none has one."""
    known = [*METRICS, *(f"paper_{metric}" for metric in METRICS), "nees"]
    percent = np.arange(101)
    found = pd.concat(tables)[known].quantile(percent / 100).reset_index(drop=True)
    return found.assign(percent=percent)[["percent", *known]]


def answers(tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """How many images with the ring in view, ``in_view``, had which answer, ``status``."""
    counts = pd.concat(tables).query("in_view").status.value_counts().sort_index()
    return counts.rename("in_view").reset_index()


def promise(tables: Sequence[pd.DataFrame], groups: int = 10) -> pd.DataFrame:
    """Predicted and actual errors, of poses in ``groups`` of equal size by what was predicted.

    Returns
    -------
    DataFrame
        ``what`` (``position_m`` or ``normal_deg``), ``group``, the median ``predicted`` standard deviation
        along the worst direction, the median ``error`` and its 95 % quantile ``most``.
    """
    table, rows = pd.concat(tables), []
    for what, predicted, error in (
        ("position_m", "position_sigma_m", "position_error_m"),
        ("normal_deg", "normal_sigma_deg", "normal_error_deg"),
    ):
        known = table[[predicted, error]].dropna().sort_values(predicted)
        for group, some in enumerate(np.array_split(known.to_numpy(), groups)):
            if len(some):
                rows.append((what, group, *np.median(some, axis=0), np.quantile(some[:, 1], 0.95)))
    return pd.DataFrame(rows, columns=["what", "group", "predicted", "error", "most"])


def versus(one: Sequence[pd.DataFrame], other: Sequence[pd.DataFrame], metric: str, draws: int,
           seed: int = 0) -> dict:  # fmt: skip
    """How much larger the median of ``metric`` is in ``one`` than in ``other``, `errors` of the same
    sequences, over images of both at nearly the same time (50 ms), with its 95 % interval."""
    known = [[t[["t_us", metric]].dropna() for t in tables] for tables in (one, other)]
    pairs = [pd.merge_asof(*pair, on="t_us", direction="nearest", tolerance=50_000).dropna()
             for pair in zip(*known, strict=True)]  # fmt: skip
    both, counts = pd.concat(pairs), drawn_counts([len(pair) for pair in pairs if len(pair)], draws, seed)
    a, b = both[f"{metric}_x"], both[f"{metric}_y"]
    low, high = bootstrap.interval(bootstrap.medians(a, counts) - bootstrap.medians(b, counts))
    return {"difference": a.median() - b.median(), "low": low, "high": high, "images": len(both)}


def against_better(tables: Mapping[str, Sequence[pd.DataFrame]], draws: int, seed: int = 0) -> pd.DataFrame:
    """`versus` of the fused track and the camera with the smaller median, by ``metric``; ``better`` names it.

    Parameters
    ----------
    tables : `errors` of the same sequences, by modality and of ``fused``
    """
    rows = []
    for metric in METRICS:
        medians = {m: pd.concat(tables[m])[metric].median() for m in MODALITIES}
        better = min(medians, key=medians.get)
        apart = versus(tables["fused"], tables[better], metric, draws, seed)
        rows.append({"metric": metric, "better": better, **apart})
    return pd.DataFrame(rows)
