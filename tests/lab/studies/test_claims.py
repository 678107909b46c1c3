"""Claims judged on tables made so that the verdict is known."""

import numpy as np
import pandas as pd
import pytest

from lmmap_lab.provenance import DATA
from lmmap_lab.studies.claims import claims
from lmmap_lab.studies.verdicts import (
    COLUMNS,
    ESTIMATORS,
    FAILS,
    HOLDS,
    NOT_RUN,
    PARTLY,
    TRIED,
    UNTESTED,
    row,
    verdict,
)

LIGHTS = ("low", "medium", "high")
COUNTS = {  # images, ellipses, poses
    ("hard-slow", "rgb"): (100, 100, 100), ("hard-slow", "event"): (100, 2, 0),
    ("hard-slow", "fused"): (100, 0, 100), ("hard-reflect", "rgb"): (100, 0, 0),
    ("hard-reflect", "event"): (100, 90, 80), ("hard-reflect", "fused"): (100, 0, 90),
    ("empty-0", "rgb"): (3000, 0, 1), ("empty-0", "event"): (3000, 0, 0), ("empty-0", "fused"): (3000, 0, 9),
}  # fmt: skip
IOU = {"low": (0.9, 0.9, 0.9), "high": (0.85, 0.8, 0.5)}  # of the ring's mask by domain gap, in `LIGHTS`


def made(**changed):
    """Tables in which each estimator has exactly the paper's numbers."""
    table = pd.read_csv(DATA / "paper" / "table1.csv").rename(columns={"value": "table1"})
    for name in ESTIMATORS:
        table[name] = table.table1
        table[f"{name}_low"], table[f"{name}_high"] = 0.9 * table.table1, 1.1 * table.table1
    columns = ["sequence", "modality", "images", "ellipses", "poses"]
    counts = pd.DataFrame([(*k, *v) for k, v in COUNTS.items()], columns=columns)
    saturation = pd.DataFrame(
        {"light": LIGHTS, "low": 1.0, "high": 0.0, "rank_correlation": [0.1, -0.2, 0.0]}
    )
    filters = pd.DataFrame(
        [(gap, "ring", "rgb", *at) for gap, ious in IOU.items() for at in zip(LIGHTS, ious, strict=True)],
        columns=["domain_gap", "filter", "modality", "light", "iou"],
    )
    tables = {"table": table, "counts": counts, "saturation": saturation, "filters": filters}
    return tables | changed


def judged(tables):
    verdicts = claims(**tables)
    assert list(verdicts) == COLUMNS and not verdicts.isna().any().any()
    return verdicts.set_index("claim")


def of(verdicts, words, column="verdict"):
    (answer,) = verdicts[column][verdicts.index.str.contains(words, regex=False)]
    return answer


def test_with_the_papers_numbers_its_claims_hold():
    verdicts = judged(made())
    known = verdicts.verdict[~verdicts.verdict.isin([UNTESTED, TRIED])]
    own = known[~known.index.str.contains("events are enough|ORB-SLAM3")]  # judged by committed results
    assert (own == HOLDS).all() and len(own) == 15
    assert (verdicts.verdict == UNTESTED).sum() == 3
    assert list(verdicts.index[verdicts.verdict == TRIED]) == [verdicts.index[-1]]


def test_each_estimator_has_its_own_verdict_and_the_named_one_decides():
    tables = made()
    table = tables["table"]
    events = table.modality == "event"
    table.loc[events, ["printed", "printed_low", "printed_high"]] *= 3
    verdicts = judged(tables)
    for claim in ("alike in low; medium; high", "clearly better than frames"):
        assert of(verdicts, claim, "printed_verdict") == FAILS and of(verdicts, claim) == HOLDS
        assert of(verdicts, claim, "ours_verdict") == HOLDS and of(verdicts, claim, "decides") == "as printed"

    table.loc[table.metric == "normal_error_deg", "ours"] = 0.5
    verdicts = judged(tables)
    assert of(verdicts, "normal poor") == FAILS and of(verdicts, "normal poor", "decides") == "ours"
    assert of(verdicts, "normal poor", "as_printed_verdict") == HOLDS


def test_without_the_papers_procedure_its_formula_decides():
    tables = made()
    ends = [f"as_printed{end}" for end in ("", "_low", "_high")]
    verdicts = judged(made(table=tables["table"].drop(columns=ends)))
    assert (verdicts.as_printed_verdict == NOT_RUN).all()
    assert of(verdicts, "lowers the RMSE", "decides") == "printed formula"


def test_partly_is_a_verdict():
    assert [verdict(v) for v in ([True, True], [True, False], [False, False])] == [HOLDS, PARTLY, FAILS]
    tables = made()
    table, counts = tables["table"], tables["counts"]
    bright = (table.light == "high") & (table.modality == "event")
    table.loc[bright & (table.metric == "position_error_m"), "as_printed"] *= 2
    counts.loc[(counts.sequence == "hard-reflect") & (counts.modality == "rgb"), "ellipses"] = 40
    tables["saturation"]["rank_correlation"] = [0.0, 0.5, 0.0]
    verdicts = judged(tables)
    assert of(verdicts, "alike in low; medium; high") == PARTLY
    assert of(verdicts, "Full reflect") == PARTLY == of(verdicts, "does not correlate")


def test_a_claim_falls_with_its_numbers():
    tables = made()
    table, counts = tables["table"], tables["counts"]
    kept = table.outlier_filter == "with"
    table.loc[kept & (table.statistic == "rmse"), "as_printed"] *= 10
    counts.loc[(counts.sequence == "hard-slow") & (counts.modality == "event"), "ellipses"] = 90
    counts.loc[counts.sequence == "empty-0", "poses"] = 30
    tables["filters"]["iou"] = 0.9
    across = (table.training == "high-domain-gap") & (table.metric == "detection_rate_percent")
    table.loc[across, "as_printed"] = 20
    verdicts = judged(tables)
    for words in (
        "lowers the RMSE",
        "Slow motion",
        "False detections",
        "look alike",
        "no network was trained",
    ):
        assert of(verdicts, words) == FAILS
    assert of(verdicts, "costs detections") == HOLDS == of(verdicts, "Full reflect")


def test_an_empty_cell_is_no_verdict():
    tables = made()
    high = tables["table"].query("training == 'high-domain-gap' and light == 'high'")
    cells = high.query("modality == 'event' and outlier_filter == 'with'").index
    tables["table"].loc[cells, "as_printed"] = np.nan
    verdicts = judged(tables)
    assert of(verdicts, "clearly better than frames") == UNTESTED
    assert of(verdicts, "alike in low; medium light") == HOLDS


@pytest.mark.parametrize("images", [50, 400])
def test_too_few_images_say_nothing_about_rare_events(images):
    tables = made()
    empty = tables["counts"].sequence == "empty-0"
    tables["counts"].loc[empty, ["images", "poses"]] = [images, 0]
    assert of(judged(tables), "False detections") == UNTESTED


def test_a_row_without_a_word_of_an_estimator_says_so():
    only = row("c", "p", {"ours": ("1", HOLDS)}, "w", decides="ours")
    assert only["printed"] == only["printed_verdict"] == NOT_RUN and only["verdict"] == HOLDS
