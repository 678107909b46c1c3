"""Tables of errors in words and units, narrow enough for a page, with the same bytes each time."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np
import pandas as pd

from lmmap.recordings.columns import TABLE

from ..studies.verdicts import FAILS, HOLDS, PARTLY

STATISTICS = ("median", "in_fov", "rmse", "all")
WORDS = {  # what a table calls a metric and its statistic
    ("position_error_m", "median"): "position (mm)",
    ("normal_error_deg", "median"): "normal (°)",
    ("rotation_error_deg", "median"): "rotation (°)",
    ("detection_rate_percent", "in_fov"): "found, ring in view (%)",
    ("wrong_percent", "in_fov"): "wrong, ring in view (%)",
    ("position_error_m", "rmse"): "position, RMSE (mm)",
    ("normal_error_deg", "rmse"): "normal, RMSE (°)",
    ("rotation_error_deg", "rmse"): "rotation, RMSE (°)",
    ("detection_rate_percent", "all"): "found, all images (%)",
}
DIGITS = {"detection_rate_percent": 1, "wrong_percent": 1}  # after the point; of other metrics two
ESTIMATORS = {"table1": "paper", "as_printed": "as printed", "ours": "ours", "fused": "fused"}
LIGHTS = {"low": "low light", "medium": "medium light", "high": "high light"}
CAMERAS = {"rgb": "frames", "event": "events", "fused": "fused"}
CELL, INTERVAL = ["metric", "statistic", "light", "modality"], ("value", "low", "high")
ANSWERS = {"ok": "a pose", "no_ring": "no ring", "no_ellipse": "no ellipse", "no_markers": "no markers",
           "unsure": "unsure", "predicted": "predicted"}  # fmt: skip


def accuracy_table(compared: pd.DataFrame, statistics: Sequence[str] = STATISTICS,
                   estimators: Mapping[str, str] = ESTIMATORS) -> pd.DataFrame:  # fmt: skip
    """Rows of `table1.compare` in words: a value, and in brackets its 95 % interval if it has one.

    Parameters
    ----------
    compared
        Cells of one domain gap, with or without outlier filter.
    estimators
        What the table calls the columns of ``compared`` that it shows.

    Returns
    -------
    DataFrame
        A row per metric and estimator, a column per light and camera; positions are in mm.
    """
    missing, parts = compared.table1 * np.nan, []
    for column, estimator in estimators.items():
        ends = (compared.get(column + end, missing) for end in ("", "_low", "_high"))
        digits = compared.metric.map(DIGITS).fillna(2).astype(int)
        if column == "table1":  # whole millimetres
            digits = digits.where(compared.metric != "position_error_m", 0)
        cells = compared[CELL].assign(**dict(zip(INTERVAL, ends, strict=True)), digits=digits)
        parts.append(cells.assign(row=estimator))
    wide = wide_table(pd.concat(parts), statistics, list(estimators.values()))
    unstated = WORDS["wrong_percent", "in_fov"], estimators.get("table1")
    if unstated in wide.index:
        wide = wide.astype(object)
        wide.loc[unstated, wide.notna().any()] = "not stated"
    return wide


def wide_table(cells: pd.DataFrame, statistics: Sequence[str], rows: Sequence[str]) -> pd.DataFrame:
    """Texts of cells, a row per metric and each of ``rows``, a column per light and camera.

    Parameters
    ----------
    cells
        ``metric, statistic, light, modality``, ``row`` (one of ``rows``), ``value, low, high``, and how many
        ``digits`` these have after the point.
    """
    cells = cells[cells.statistic.isin(statistics)]
    scale = np.where(cells.metric == "position_error_m", 1e3, 1.0)
    ends = (cells[name] * scale for name in INTERVAL)
    texts = cells.assign(
        title=metric_titles(cells), light=cells.light.map(LIGHTS), camera=cells.modality.map(CAMERAS),
        text=[_with_interval(*values) for values in zip(*ends, cells.digits, strict=True)],
    )  # fmt: skip
    wide = texts.pivot(index=["title", "row"], columns=["light", "camera"], values="text")
    index = product([words for (_, statistic), words in WORDS.items() if statistic in statistics], rows)
    wide = wide.reindex(index=list(index), columns=list(product(LIGHTS.values(), ("frames", "events"))))
    return wide.dropna(how="all").rename_axis(index=(None, None), columns=(None, None))


def metric_titles(cells: pd.DataFrame) -> list[str]:
    """What tables call each row's ``metric`` and ``statistic``."""
    return [WORDS[key] for key in zip(cells.metric, cells.statistic, strict=True)]


def _with_interval(value: float, lower: float, upper: float, digits: int) -> str:
    if not np.isfinite(value):
        return "none"
    ends = [f"{end:.{digits}f}" for end in (lower, upper) if np.isfinite(end)]
    return f"{value:.{digits}f}" + (f" ({' to '.join(ends)})" if len(set(ends)) == 2 else "")


def with_ends(value: float, low: float, high: float, form: str = ".0f") -> str:
    """A number with the ends of its interval, each in a format: "90 (85 to 94)"."""
    return f"{value:{form}} ({low:{form}} to {high:{form}})"


def shares_with_ends(rows: pd.DataFrame, what: str, form: str = ".0f") -> pd.Series:
    """`with_ends` of the columns ``WHAT_percent, WHAT_low, WHAT_high`` of each row."""
    return rows[[f"{what}_{end}" for end in ("percent", "low", "high")]].agg(
        lambda row: with_ends(*row, form), axis=1
    )


def facts_in_words(facts: Mapping) -> dict[str, str]:
    """Numbers by names as of a file, "largest_gap_ms", in words: "largest gap (ms)", and as texts."""
    units = {"px": "px", "s": "s", "ms": "ms", "hz": "Hz", "mm": "mm", "deg": "°", "percent": "%"}
    words = {}
    for name, value in facts.items():
        *first, last = name.split("_")
        unit = f" ({units[last]})" if last in units and not first[-1].isdigit() else f" {last}"
        words[(" ".join(first) + unit).strip()] = _fact(value)
    return words


def _fact(value) -> str:
    if isinstance(value, bool | np.bool):
        return "yes" if value else "no"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return " to ".join(map(_fact, value))
    if isinstance(value, float | np.floating):
        return f"{value:,.0f}" if value >= 1000 else f"{value:.2f}"
    return f"{value:,}" if isinstance(value, int | np.integer) else str(value)


def small_intervals(table: pd.DataFrame):
    """A styled table of texts; what a text has in brackets stands in small print under it."""
    return table.style.format(lambda text: text.replace(" (", "<br><small>").replace(")", "</small>"))


def sentence_table(table: pd.DataFrame, classes: str = "sentences"):
    """A styled table without index, whose cells may take several lines."""
    return table.style.hide().set_table_attributes(f'class="{classes}"')


def rules(claims: pd.DataFrame) -> pd.Series:
    """In small print, what a claim's numbers are, and the rule of its verdict or why it has none."""
    numbers = ("Numbers: " + claims.numbers + ". ").where(claims.numbers != "in words", "")
    judged = claims.verdict.isin([HOLDS, PARTLY, FAILS]).map({True: "Holds if: ", False: "No verdict: "})
    reasons = claims.why.str.replace(r"`(.+?)`", r"<code>\1</code>", regex=True)
    return "<br><small>" + numbers + judged + reasons + "</small>"


def to_html(styled) -> str:
    """HTML of a styled table; its identifier comes from its content, where pandas would draw a random one."""
    content = styled.to_html(table_uuid="table")
    return styled.to_html(table_uuid=hashlib.sha256(content.encode()).hexdigest()[:8])


def to_text(styled) -> str:
    """Values of a styled table in letters of one width, for print."""
    return styled.data.to_string(index=not any(styled.hide_index_))


def estimate_columns() -> list[tuple[str, str, str, str]]:
    """Rows ``(columns, unit, frame, meaning)`` for a page; of many columns the first and the last."""
    return [
        (", ".join(names) if len(names) < 6 else f"{names[0]} … {names[-1]}", unit, frame, meaning)
        for names, unit, frame, meaning in TABLE
    ]
