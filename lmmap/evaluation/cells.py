"""The cells of the paper's table of errors: each is a statistic of values, one for each image."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import product
from typing import NamedTuple

import numpy as np
import pandas as pd

from .error_table import METRICS, is_wrong

VARIANTS = {  # prefix of the errors' columns, column that selects poses, column of those that are kept
    "exact": ("", None, "kept"),
    "printed": ("paper_", None, "paper_kept"),
    "certain": ("", "certain", "certain_kept"),
}


class Cell(NamedTuple):
    """A cell's name, its statistic as a function, and the values (N,) that it is computed from; NaN marks an
    image that does not count."""

    outlier_filter: str
    metric: str
    variant: str
    statistic: str
    function: Callable[[np.ndarray], float]
    values: np.ndarray


def median(values: np.ndarray) -> float:
    """Median of the finite values in (N,), or NaN if no value is finite."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else np.nan


def root_mean_square(values: np.ndarray) -> float:
    """Root mean square of the finite values in (N,), or NaN if no value is finite."""
    known = values[np.isfinite(values)]
    each_once = np.ones(len(known))  # adds up as the bootstrap does, to the last digit
    return float(np.sqrt(each_once @ known**2 / len(known))) if len(known) else np.nan


def percent(flags: np.ndarray) -> float:
    """Percentage of ones among the flags (N,) that are not NaN, or NaN if all of them are."""
    known = flags[np.isfinite(flags)]
    return float(100 * np.mean(known)) if len(known) else np.nan


def cells(table: pd.DataFrame, variants: Mapping[str, tuple] = VARIANTS) -> Iterator[Cell]:
    """Yield median and RMSE of each error, detection rates, and the percentage of wrong poses (`is_wrong`)
    among images with the whole ring in view, for each of ``variants``, without and with outlier filter.

    Parameters
    ----------
    table
        `error_table.errors` of a recording, or of several together.
    """
    in_view = table.in_view.astype(bool)
    for (variant, (prefix, selection, kept)), filtered in product(variants.items(), ("without", "with")):
        detected = table[prefix + METRICS[0]].notna() & (table[selection] if selection else True)
        detected &= table[kept] if filtered == "with" else True
        for metric in METRICS:
            values = table[prefix + metric].where(detected).to_numpy(float)
            yield Cell(filtered, metric, variant, "median", median, values)
            yield Cell(filtered, metric, variant, "rmse", root_mean_square, values)
        found, wrong = detected.astype(float), (detected & is_wrong(table, prefix)).astype(float)
        for metric, statistic, flags in (
            ("detection_rate_percent", "all", found),
            ("detection_rate_percent", "in_fov", found.where(in_view)),
            ("wrong_percent", "in_fov", wrong.where(in_view)),
        ):
            yield Cell(filtered, metric, variant, statistic, percent, flags.to_numpy())


def summary(table: pd.DataFrame, variants: Mapping[str, tuple] = VARIANTS) -> pd.DataFrame:
    """Table of `cells` with the columns ``outlier_filter, metric, variant, statistic, value``."""
    rows = [(*cell[:4], cell.function(cell.values)) for cell in cells(table, variants)]
    return pd.DataFrame(rows, columns=[*Cell._fields[:4], "value"])
