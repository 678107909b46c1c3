"""Tables of the chapter on accuracy, from the committed tables of the study."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np
import pandas as pd

from ..studies.accuracy_run import COMMITTED, run_before
from ..studies.ladder import RUNGS
from ..studies.verdicts import ESTIMATORS, NOT_RUN
from .tables import CAMERAS, LIGHTS, WORDS, metric_titles, sentence_table, with_ends

GAPS = {"low-domain-gap": "low domain gap", "high-domain-gap": "high domain gap"}


def when_made(commit: str, before: Sequence[str]) -> str:
    """Of which estimator the committed tables are: that of a ``commit``, which ran the sequences ``before``
    with another estimator, networks or environment than the present ones.

    Tables are made of all sequences at once, so those that were run again do not change them yet.
    """
    if not before:
        return f"made at {commit}, with the present estimator and networks"
    return (f"made at {commit}; the estimator, its networks or its packages have changed since, so that now "
            "the numbers may be better or worse")  # fmt: skip


def paper_tables_made() -> str:
    """`when_made` of the committed tables of the paper's durations."""
    commit = json.loads((COMMITTED / "summary.provenance.json").read_text())["commit"]
    return when_made(commit, run_before("paper"))


def difference_counts(compared: pd.DataFrame):
    """In how many cells our result differs from the paper's, styled: a row per metric, columns by domain gap.

    A cell of `table1.compare` counts as alike where the paper's value lies in our 95 % interval, and
    otherwise as better or worse.
    """
    compared = compared[compared.metric != "wrong_percent"]  # of which the paper says nothing
    more_is_better = compared.metric == "detection_rate_percent"
    inside = compared.table1.between(compared.ours_low, compared.ours_high)
    better = (compared.ours > compared.table1) == more_is_better
    judged = compared[["training"]].assign(
        title=metric_titles(compared), verdict=np.select([inside, better], ["alike", "better"], "worse")
    )
    counts = judged.groupby(["title", "training", "verdict"]).size()
    counts = counts.unstack(["training", "verdict"], fill_value=0)
    columns = list(product(GAPS, ("better", "alike", "worse")))
    stated = [words for (metric, _), words in WORDS.items() if metric != "wrong_percent"]
    counts = counts.reindex(index=stated, columns=columns, fill_value=0)
    return counts.rename(GAPS, axis=1).rename_axis(index=None, columns=(None, None)).style


def detection_rates(answers: pd.DataFrame, compared: pd.DataFrame):
    """How often an image that shows the whole ring gives a pose or at least an ellipse, in percent, styled.

    Parameters
    ----------
    answers : `error_statistics.answers` by ``training``, ``light`` and ``modality``
    compared : `table1.compare`
    """
    rows = {"table1": "a pose, paper", "ours": "a pose, ours", "ellipse": "an ellipse, ours"}
    cell = ["training", "light", "modality"]
    counts = answers.assign(
        ellipse=answers.in_view.where(answers.status.isin(["ok", "no_markers", "unsure"]), 0)
    )
    counts = counts.groupby(cell)[["ellipse", "in_view"]].sum()
    rates = compared[compared.metric == "detection_rate_percent"]
    rates = rates.query("statistic == 'in_fov' and outlier_filter == 'without'").set_index(cell)
    rates = rates.assign(ellipse=100 * counts.ellipse / counts.in_view)[list(rows)].stack().unstack(cell[1:])
    return _rename(rates.reindex(index=list(product(GAPS, rows))), GAPS | rows)


def _rename(wide: pd.DataFrame, rows: dict | None = None):
    """A table by light and modality in words and to a digit, styled."""
    wide = wide.reindex(columns=list(product(LIGHTS, ("rgb", "event")))).rename(rows or {})
    wide = wide.rename(LIGHTS | CAMERAS, axis=1)
    return wide.rename_axis(index=[None] * wide.index.nlevels, columns=(None, None)).style.format(precision=1)


def ladder_table(rungs: pd.DataFrame):
    """Cells of ``ladder.csv`` of one domain gap, without outlier filter, styled: a row a rung, a column a
    light and camera."""
    cells = rungs[rungs.outlier_filter == "without"].set_index(["metric", "statistic"])
    tables = {}
    for key in (("normal_error_deg", "median"), ("position_error_m", "rmse"),
                ("detection_rate_percent", "in_fov"), ("wrong_percent", "in_fov")):  # fmt: skip
        scale = 1e3 if key[0] == "position_error_m" else 1.0
        wide = cells.loc[[key]].pivot(index="rung", columns=["light", "modality"], values="value")
        tables[WORDS[key]] = scale * wide.loc[list(RUNGS)]
    return _rename(pd.concat(tables))


def assumptions_table(effects: pd.DataFrame):
    """`assumptions.effects` in words, styled: a row a change."""
    words = {"mask_threshold": "threshold of the mask", "min_ring_pixels": "least pixels (gamma_S)",
             "ransac_hypotheses": "ellipses drawn (H)", "min_axis_ratio": "least ratio of the axes",
             "ransac_tolerance_px": "an inlier's distance (px)", "none": "all as assumed"}  # fmt: skip
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


def saturation_table(shares: pd.DataFrame, paper_percent: np.ndarray):
    """Shares of black and of white pixels by light, the paper's and ours, styled.

    Parameters
    ----------
    shares
        ``light``, black (``low``) and white (``high``) in percent, and their ``rank_correlation`` with the
        position error.
    paper_percent
        The paper's black and white shares by light, (3, 2).
    """
    paper = pd.DataFrame(paper_percent, list(LIGHTS), ["low", "high"])
    ours = shares.set_index("light").loc[list(LIGHTS)]
    sources = {"paper": paper, "ours": ours}
    columns = {(f"{word} (%)", source): percent[column]
               for column, word in (("low", "black"), ("high", "white"))
               for source, percent in sources.items()}  # fmt: skip
    table = pd.DataFrame({**columns, ("rank correlation", "with the error"): ours.rank_correlation})
    return table.rename(LIGHTS).style.format(precision=1).format("{:.2f}", table.columns[-1:].tolist())


def coverage_table(coverage: pd.DataFrame) -> pd.DataFrame:
    """`error_statistics.coverage` by ``modality`` and ``light``: percent, in brackets its 95 % interval."""
    ends = zip(coverage.inside_95_percent, coverage.low, coverage.high, strict=True)
    texts = coverage.replace({"modality": CAMERAS, "light": LIGHTS}).assign(
        text=[with_ends(*values) for values in ends]
    )
    wide = texts.pivot(index="modality", columns="light", values="text")
    wide = wide.reindex(index=list(CAMERAS.values()), columns=list(LIGHTS.values()))
    return wide.rename_axis(index=None, columns=None)


def sequence_table(table: pd.DataFrame):
    """`error_statistics.sequence_summary` by ``sequence`` and ``modality`` in words, styled."""
    words = {key: WORDS[key, "median"] for key in ("position_error_m", "normal_error_deg")}
    words |= {"found_percent": WORDS["detection_rate_percent", "in_fov"],
              "inside_95_percent": "inside the 95 % region (%)"}  # fmt: skip
    rows = table.assign(position_error_m=1e3 * table.position_error_m, camera=table.modality.map(CAMERAS))
    rows = rows.sort_values("sequence", kind="stable").set_index(["sequence", "camera"])[list(words)]
    return rows.rename(columns=words).rename_axis(index=(None, None)).style.format(precision=2)


def claims_table(claims: pd.DataFrame):
    """`claims.claims`, styled: in small print under each claim what its numbers are and the rule, and under
    each verdict its numbers; the verdict that decides stands in bold letters."""
    reasons = claims.why.str.replace(r"`(.+?)`", r"<code>\1</code>", regex=True)
    numbers = ("Numbers: " + claims.numbers + ". ").mask(claims.numbers == "in words", "")
    columns = {
        "": claims.part,
        "the paper's words": claims.claim + "<br><small>" + numbers + "Holds if: " + reasons + "</small>",
        "paper": claims.paper,
    }
    for estimator, name in ESTIMATORS.items():
        verdict = claims[f"{estimator}_verdict"]
        numbers = claims[estimator].where(claims[estimator] != NOT_RUN, "")
        shown = verdict.mask(claims.decides == name, "<b>" + verdict + "</b>")
        columns[name] = shown.replace(NOT_RUN, "") + "<br><small>" + numbers + "</small>"
    return sentence_table(pd.DataFrame(columns))
