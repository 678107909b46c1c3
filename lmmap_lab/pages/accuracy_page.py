"""Tables of the chapter on accuracy, from the committed tables of the study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product

import pandas as pd

from ..studies.accuracy_run import run_before
from ..studies.ladder import RUNGS
from ..studies.verdicts import ESTIMATORS, NOT_RUN
from .tables import CAMERAS, LIGHTS, WORDS, accuracy_table, rules, sentence_table, with_ends


def when_made(before: Sequence[str]) -> str:
    """Whether the committed tables are of the current estimator, networks and environment, or whether others
    ran the sequences ``before``.

    Tables are made of all sequences at once, so those that were run again do not change them yet.
    """
    if not before:
        return "made with the current estimator and networks"
    return ("made before the estimator, its networks or its packages changed, so that now the numbers may be "
            "better or worse")  # fmt: skip


def paper_tables_made() -> str:
    """`when_made` of the committed tables of the full test."""
    return when_made(run_before("paper"))


def gap_table(high: pd.DataFrame, low: pd.DataFrame) -> pd.DataFrame:
    """Positions, found and wrong poses of either set of networks, as texts with intervals: under each of them
    a row for the paper and one for ours, a column a light and camera.

    Parameters
    ----------
    high, low : rows of `table1.compare` of a domain gap and of one choice of outlier filter
    """
    shown = {"position_error_m": "median", "detection_rate_percent": "in_fov", "wrong_percent": "in_fov"}
    parts = []
    for gap, cells in (("high", high), ("low", low)):
        cells = cells[cells.statistic == cells.metric.map(shown)]
        rows = {"table1": f"paper, {gap} gap", "ours": f"ours, {gap} gap"}
        parts.append(accuracy_table(cells, ("median", "in_fov"), rows))
    wide = pd.concat(parts).reindex([WORDS[key] for key in shown.items()], level=0)
    return wide[(wide != "not stated").any(axis=1)]


def ladder_table(rungs: pd.DataFrame):
    """Cells of ``ladder.csv`` of one domain gap, without outlier filter, styled: a row a rung, a column a
    light and camera."""
    cells = rungs[rungs.outlier_filter == "without"].set_index(["metric", "statistic"])
    tables = {}
    for key in (("normal_error_deg", "median"), ("position_error_m", "rmse"),
                ("detection_rate_percent", "in_fov"), ("wrong_percent", "in_fov")):  # fmt: skip
        scale = 1e3 if key[0] == "position_error_m" else 1.0
        wide = cells.loc[[key]].pivot(index="rung", columns=["light", "modality"], values="value")
        tables[WORDS[key]] = scale * wide.loc[list(RUNGS), list(product(LIGHTS, ("rgb", "event")))]
    table = pd.concat(tables).rename(LIGHTS | CAMERAS, axis=1)
    return table.rename_axis(index=(None, None), columns=(None, None)).style.format(precision=1)


def assumptions_table(effects: pd.DataFrame):
    """`assumptions.effects` in words, styled: a row a change."""
    words = {"mask_threshold": "mask threshold", "min_ring_pixels": "minimum ring pixels",
             "ransac_hypotheses": "RANSAC hypotheses", "min_axis_ratio": "minimum axis ratio",
             "ransac_tolerance_px": "inlier tolerance (px)", "none": "all as assumed"}  # fmt: skip
    columns = {"found_percent": "found (%)", "wrong_percent": "wrong (%)", "position_mm": "position (mm)",
               "normal_deg": "normal (°)"}  # fmt: skip
    value = effects.value.map(lambda v: f" to {v:g}", na_action="ignore").fillna("")
    change = effects.change.replace("as assumed", "") + value
    rows = effects.assign(assumption=effects.assumption.map(words), change=change)
    rows = rows.set_index(["assumption", "change"])[list(columns)].rename(columns=columns)
    return rows.rename_axis(index=(None, None)).style.format(precision=1, na_rep="none")


def default_table(table: pd.DataFrame):
    """`accuracy_tables.of_networks` of the images with the ring in view in words, styled."""
    return _in_words(table).style.format(precision=1)


def sets_table(tables: Mapping[str, pd.DataFrame]):
    """Several sets' `accuracy_tables.of_networks` side by side, styled: right and wrong poses, and the median
    error of their position."""
    shown = ["right (%)", "wrong (%)", "position (mm)"]
    wide = pd.concat({name: _in_words(table)[shown] for name, table in tables.items()}, axis=1)
    return wide.swaplevel(axis=1)[list(product(shown, tables))].style.format(precision=1)


def _in_words(table: pd.DataFrame) -> pd.DataFrame:
    columns = {"right_percent": "right (%)", "wrong_percent": "wrong (%)", "none_percent": "no pose (%)",
               "position_error_m": "position (mm)", "normal_error_deg": "normal (°)",
               "inside_95_percent": "in the 95 % region (%)"}  # fmt: skip
    rows = table[table.light.isin(list(LIGHTS))].assign(position_error_m=1e3 * table.position_error_m)
    rows = rows.replace({"modality": CAMERAS, "light": LIGHTS}).set_index(["light", "modality"])
    return rows[list(columns)].rename(columns=columns).rename_axis(index=(None, None))


def coverage_table(coverage: pd.DataFrame) -> pd.DataFrame:
    """`error_statistics.coverage` by ``modality`` and ``light``: percent, in brackets its 95 % interval."""
    ends = zip(coverage.inside_95_percent, coverage.low, coverage.high, strict=True)
    texts = coverage.replace({"modality": CAMERAS, "light": LIGHTS}).assign(
        text=[with_ends(*values) for values in ends]
    )
    wide = texts.pivot(index="modality", columns="light", values="text")
    wide = wide.reindex(index=list(CAMERAS.values()), columns=list(LIGHTS.values()))
    return wide.rename_axis(index=None, columns=None)


def claims_table(claims: pd.DataFrame):
    """`claims.claims` as a `sentence_table`: each claim with what it is about and its `rules` in small print,
    the numbers under each verdict, and in bold letters the verdict that decides."""
    pairs = ["numbers", "paper", *ESTIMATORS]  # pairs of cells, in a light after the other
    claims = claims.assign(**claims[pairs].apply(lambda texts: texts.str.replace(" | ", " and ")))
    words = claims.claim + " <small>(" + claims.part + ")</small>" + rules(claims)
    columns = {"the paper's words": words, "paper": claims.paper}
    for estimator, name in ESTIMATORS.items():
        verdict = claims[f"{estimator}_verdict"]
        found = claims[estimator].where(claims[estimator] != NOT_RUN, "")
        shown = verdict.mask(claims.decides == name, "<b>" + verdict + "</b>")
        columns[name] = shown.replace(NOT_RUN, "") + "<br><small>" + found + "</small>"
    return sentence_table(pd.DataFrame(columns), "sentences claims")
