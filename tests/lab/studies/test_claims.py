"""Claims judged on tables made so that the verdict is known."""

import numpy as np
import pandas as pd
import pytest

from lmmap.types import Camera, Port, Pose
from lmmap_lab.provenance import DATA
from lmmap_lab.studies import claims as claims_module
from lmmap_lab.studies import domain_gap, five_degrees_study
from lmmap_lab.studies.accuracy_run import COMMITTED, claims_of
from lmmap_lab.studies.claims import claims
from lmmap_lab.studies.claims_of_cameras import claims_of_cameras
from lmmap_lab.studies.claims_of_method import roots_apart_rad
from lmmap_lab.studies.five_degrees_fit import ASKEW, NOISE
from lmmap_lab.studies.sensitivity import tilted_pose
from lmmap_lab.studies.verdicts import (
    ASKED,
    COLUMNS,
    ESTIMATORS,
    FAILS,
    HOLDS,
    NOT_RUN,
    PARTLY,
    TRIED,
    UNTESTED,
    paper_claims,
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
    assert set(verdicts.key) == set(paper_claims().index) and verdicts.key.is_unique
    return verdicts.set_index("key")


def of(verdicts, key, column="verdict"):
    return verdicts.loc[key, column]


def test_with_the_papers_numbers_its_claims_hold():
    """Those that the tables judge; the others rest on the geometry and on committed results."""
    verdicts = judged(made())
    own = [
        "alike_high_gap", "events_win", "alike_low_gap", "events_either_gap", "not_hdr", "saturation",
        "frames_alike_in_low_light", "filter_rmse", "filter_rate", "normal_poor", "position_without_filter",
        "slow_blinds_events", "reflect_blinds_frames",
        "both_are_needed", "false_detections", "filter_median",
    ]  # fmt: skip
    assert (verdicts.verdict[own] == HOLDS).all()


def test_what_is_no_sentence_of_the_paper_is_no_claim_and_causes_stand_apart():
    claims_of_paper = paper_claims()
    assert set(claims_of_paper.part) == {"observed", "cause", "of the method", "future work", "our question"}
    assert not claims_of_paper.claim.str.contains("35,000|real sensors").any()
    pairs = {
        "events_win": "not_hdr",
        "normal_poor": "sensitivity_explains",
        "slow_blinds_events": "noise_blinds_events",
    }
    for seen, cause in pairs.items():
        assert claims_of_paper.part[[seen, cause]].tolist() == ["observed", "cause"]


def test_a_proposal_of_the_paper_is_no_claim_and_has_no_verdict():
    assert paper_claims().part[lambda part: part == "future work"].index.tolist() == ["spikes"]
    assert of(judged(made()), "spikes") == TRIED


def test_a_question_of_ours_is_no_claim_and_has_no_verdict():
    assert paper_claims().part[lambda part: part == "our question"].index.tolist() == ["gap_without_labels"]
    verdicts = judged(made())
    assert (
        of(verdicts, "gap_without_labels") == ASKED
        and of(verdicts, "gap_without_labels", "paper") == "not asked"
    )


def test_where_events_do_not_win_there_is_nothing_to_explain():
    tables = made()
    table = tables["table"]
    ours = table.modality.eq("event") & table.training.eq("high-domain-gap")
    table.loc[ours, ["as_printed", "as_printed_low", "as_printed_high"]] *= 3
    verdicts = judged(tables)
    assert of(verdicts, "events_win") == FAILS and of(verdicts, "not_hdr") == UNTESTED
    assert of(verdicts, "events_win", "ours_verdict") == HOLDS == of(verdicts, "not_hdr", "ours_verdict")


def gap_of(frames, events, apart):
    """`domain_gap.table` of costs with intervals of 0.01, and of their difference."""
    cells = {"rgb": (frames, 0.01), "event": (events, 0.01), domain_gap.EITHER: (frames - events, apart)}
    return pd.DataFrame([
        {"place": "film", "measure": measure, "light": light, "modality": m, "quantity": "cost of the gap",
         "value": value, "low": value - half, "high": value + half}
        for measure in domain_gap.MEASURES for light in (*LIGHTS, domain_gap.ALL_LIGHTS)
        for m, (value, half) in cells.items()
    ])  # fmt: skip


@pytest.mark.parametrize(
    "frames, events, apart, verdict",
    [(0.3, 0.1, 0.05, HOLDS), (0.3, 0.1, 0.25, FAILS), (0.1, 0.3, 0.05, FAILS)],
)
def test_events_generalise_better_where_the_interval_of_the_difference_says_so(
    frames, events, apart, verdict
):
    tables = made()
    gap = gap_of(frames, events, apart)
    del tables["counts"]
    rows = {r["key"]: r for r in claims_of_cameras(**tables, gap=gap)}
    assert rows["events_generalise"]["verdict"] == verdict and rows["frames_struggle"]["verdict"] == HOLDS


def test_the_two_roots_that_the_paper_calls_similar_differ_near_by():
    """Around the printed centre they differ by degrees; far away, where both centres agree, they do not."""
    camera, port = Camera.davis346(), Port.lm_map()
    T = Pose(tilted_pose(0.6, np.deg2rad([30.0, 50.0])).rotation, [[0, 0, 0.6]] * 2)
    assert np.rad2deg(roots_apart_rad(T, camera, port.ring_radius_m)).min() > 3
    far = Pose(T.rotation, [[0, 0, 60.0]] * 2)
    assert np.rad2deg(roots_apart_rad(far, camera, port.ring_radius_m)).max() < 0.2


def test_each_estimator_has_its_own_verdict_and_the_named_one_decides():
    tables = made()
    table = tables["table"]
    events = table.modality == "event"
    table.loc[events, ["printed", "printed_low", "printed_high"]] *= 3
    verdicts = judged(tables)
    for claim in ("alike_low_gap", "events_win"):
        assert of(verdicts, claim, "printed_verdict") == FAILS and of(verdicts, claim) == HOLDS
        assert of(verdicts, claim, "ours_verdict") == HOLDS and of(verdicts, claim, "decides") == "as printed"

    table.loc[table.metric == "normal_error_deg", "ours"] = 0.5
    verdicts = judged(tables)
    assert of(verdicts, "normal_poor") == HOLDS and of(verdicts, "normal_poor", "ours_verdict") == FAILS


def test_noise_alone_fails_only_where_each_other_hypothesis_is_told_from_it():
    study = pd.read_csv(five_degrees_study.COMMITTED)
    judge = claims_module._sensitivity
    assert judge(study)["verdict"] == of(judged(made()), "sensitivity_explains")
    better = study.assign(misfit=np.where(study.hypothesis == NOISE, 1.0, 0.5), beats_noise=1.0)
    assert judge(better)["verdict"] == FAILS
    one = better.assign(beats_noise=(better.hypothesis == ASKEW).astype(float))
    assert judge(one)["verdict"] == PARTLY and judge(better.assign(beats_noise=0.5))["verdict"] == HOLDS
    assert judge(better.assign(misfit=0.5))["verdict"] == PARTLY


def test_without_the_papers_procedure_its_formula_decides():
    tables = made()
    ends = [f"as_printed{end}" for end in ("", "_low", "_high")]
    verdicts = judged(made(table=tables["table"].drop(columns=ends)))
    assert (verdicts.as_printed_verdict.drop(["satellite_agnostic", "lightweight"]) == NOT_RUN).all()
    assert of(verdicts, "filter_rmse", "decides") == "printed formula"


def test_partly_is_a_verdict():
    assert [verdict(v) for v in ([True, True], [True, False], [False, False])] == [HOLDS, PARTLY, FAILS]
    tables = made()
    table, counts = tables["table"], tables["counts"]
    bright = (table.light == "high") & (table.modality == "event")
    table.loc[bright & (table.metric == "position_error_m"), "as_printed"] *= 2
    counts.loc[(counts.sequence == "hard-reflect") & (counts.modality == "rgb"), "ellipses"] = 40
    tables["saturation"]["rank_correlation"] = [0.0, 0.5, 0.0]
    verdicts = judged(tables)
    assert of(verdicts, "alike_low_gap") == PARTLY
    assert of(verdicts, "reflect_blinds_frames") == PARTLY == of(verdicts, "saturation")


def test_a_claim_falls_with_its_numbers():
    tables = made()
    table, counts = tables["table"], tables["counts"]
    kept = table.outlier_filter == "with"
    table.loc[kept & (table.statistic == "rmse"), "as_printed"] *= 10
    counts.loc[(counts.sequence == "hard-slow") & (counts.modality == "event"), "ellipses"] = 90
    counts.loc[counts.sequence == "empty-0", "poses"] = 30
    tables["filters"]["iou"] = 0.9
    verdicts = judged(tables)
    for words in ("filter_rmse", "slow_blinds_events", "false_detections", "frames_alike_in_low_light"):
        assert of(verdicts, words) == FAILS
    assert of(verdicts, "filter_rate") == HOLDS == of(verdicts, "reflect_blinds_frames")


def test_an_empty_cell_is_no_verdict():
    tables = made()
    high = tables["table"].query("training == 'high-domain-gap' and light == 'high'")
    cells = high.query("modality == 'event' and outlier_filter == 'with'").index
    tables["table"].loc[cells, "as_printed"] = np.nan
    verdicts = judged(tables)
    assert of(verdicts, "events_win") == UNTESTED == of(verdicts, "not_hdr")
    assert of(verdicts, "alike_high_gap") == HOLDS


@pytest.mark.parametrize("images", [50, 400])
def test_too_few_images_say_nothing_about_rare_events(images):
    tables = made()
    empty = tables["counts"].sequence == "empty-0"
    tables["counts"].loc[empty, ["images", "poses"]] = [images, 0]
    assert of(judged(tables), "false_detections") == UNTESTED


def test_a_row_without_a_word_of_an_estimator_says_so():
    only = row("not_hdr", "p", {"ours": ("1", HOLDS)}, "w", decides="ours")
    assert only["printed"] == only["printed_verdict"] == NOT_RUN and only["verdict"] == HOLDS


def test_the_committed_claims_are_those_of_the_committed_tables():
    """So no number of another table is old in them."""
    again = claims_of(COMMITTED)
    kept = pd.read_csv(COMMITTED / "claims.csv")
    pd.testing.assert_frame_equal(again.reset_index(drop=True).astype(str), kept.astype(str))
