"""Tables of pages: each number where it belongs, and the same bytes each time."""

import re
from itertools import product

import numpy as np
import pandas as pd
import pytest

from lmmap.pages import tables
from lmmap.provenance import DATA
from lmmap.studies.claims import COLUMNS
from lmmap.types import Status


@pytest.fixture
def compared():
    """One quarter of the paper's table, ours twice as large with intervals, and no *certain*."""
    table = pd.read_csv(DATA / "paper" / "table1.csv").rename(columns={"value": "table1"})
    table = table.query("training == 'low-domain-gap' and outlier_filter == 'without'")
    return table.assign(ours=2 * table.table1, ours_low=table.table1, ours_high=3 * table.table1,
                        printed=table.table1, printed_low=table.table1, printed_high=table.table1,
                        fused=np.nan)  # fmt: skip


def test_a_table_says_in_words_what_the_numbers_say(compared):
    table = tables.of_accuracy(compared)
    assert len(table) == len(tables.WORDS) * len(tables.ESTIMATORS)
    for (metric, statistic, light, camera), row in compared.groupby(
        ["metric", "statistic", "light", "modality"]
    ):
        of = table[tables.LIGHTS[light], tables.CAMERAS[camera]].loc[tables.WORDS[metric, statistic]]
        scale = 1e3 if metric == "position_error_m" else 1
        value, low_high = of.ours.rstrip(")").split(" (")
        ends = [float(end) for end in low_high.split(" to ")]
        assert [float(value), *ends] == pytest.approx(
            scale * row.table1.item() * np.array([2, 1, 3]), rel=0.006
        )
        assert float(of.paper) == pytest.approx(scale * row.table1.item(), rel=0.006)
        assert of.printed == of.paper  # an interval of no width goes without saying
        assert of.fused == of.certain == "none"


def test_differences_are_counted(compared):
    ends = dict(ours_low=compared.table1, ours_high=compared.table1 + 1)
    counts = tables.of_differences(compared.assign(ours=compared.table1 + 0.5, **ends)).data
    assert counts["low domain gap", "alike"].tolist() == [6] * len(tables.WORDS)
    ends = dict(ours_low=compared.table1 + 1, ours_high=compared.table1 + 3)
    counts = tables.of_differences(compared.assign(ours=compared.table1 + 2, **ends)).data["low domain gap"]
    found = counts.index.str.startswith("found")  # more of these is better, of an error it is worse
    assert counts.better.tolist() == (6 * found).tolist() and counts.worse.tolist() == (6 * ~found).tolist()


def test_an_ellipse_without_markers_is_found_as_the_paper_counts(compared):
    cells = compared[["training", "light", "modality"]].drop_duplicates()
    answers = cells.merge(
        pd.DataFrame({"status": ["ok", "no_markers", "no_ring"], "in_view": [5, 4, 1]}), "cross"
    )
    told = tables.of_found(answers, compared).data["low light", "frames"].loc["low domain gap"]
    paper = compared.query("light == 'low' and modality == 'rgb' and statistic == 'in_fov'").table1.item()
    assert told.tolist() == pytest.approx([paper, 2 * paper, 90])


def test_hard_cases_by_hand():
    index = pd.MultiIndex.from_product([["hard-slow", "test-low"], ["rgb", "fused"]])
    counts = pd.DataFrame({"images": 40, "ellipses": [30, 0, 9, 9], "poses": [20, 40, 9, 9]}, index)
    counts = counts.assign(position_error_m=2e-3, normal_error_deg=[3.0, np.nan, 1, 1])
    table = tables.of_hard_cases(counts, {"hard-slow": "slow motion"}).data
    assert table.index.tolist() == [("slow motion", "frames"), ("slow motion", "fused")]
    assert table.loc[("slow motion", "frames")].tolist() == [100, 75, 50, 40, 2, 3]
    assert table["ellipse, ours (%)"].isna().tolist() == [False, True]


def test_sequences_stand_by_name_with_their_cameras_together():
    rows = [(f"test-low-{k}", m, 1e-3 * (k + 1), k, 99, 90) for m in tables.CAMERAS for k in range(2)]
    names = [
        "sequence",
        "modality",
        "position_error_m",
        "normal_error_deg",
        "found_percent",
        "inside_95_percent",
    ]
    told = tables.of_sequences(pd.DataFrame(rows, columns=names)).data
    assert told.index.tolist() == list(product(["test-low-0", "test-low-1"], tables.CAMERAS.values()))
    assert told.loc[("test-low-1", "fused")].tolist() == [2, 1, 99, 90]


def test_seeds_stand_one_under_the_other():
    cells = product(range(3), ("low", "medium", "high"), ("rgb", "event"), tables.WORDS, ("exact", "printed"))
    rows = [(*at, metric, statistic, variant, 1e-3 * (k + 1), 1e-3 * k, 1e-3 * (k + 2))
            for k, (*at, (metric, statistic), variant) in enumerate(cells)]  # fmt: skip
    names = ["seed", "light", "modality", "metric", "statistic", "variant", "value", "low", "high"]
    table = pd.DataFrame(rows, columns=names)
    wide = tables.of_seeds(table)
    assert wide.shape == (4 * 3, 3 * 2) and wide.notna().all(axis=None)
    one = table.query("seed == 2 and light == 'high' and modality == 'event' and variant == 'exact'")
    one = one.query("metric == 'position_error_m' and statistic == 'median'")
    mm = 1e3 * one[["value", "low", "high"]].to_numpy()[0]
    text = wide.loc[("position (mm)", "seed 2"), ("high light", "events")]
    assert [float(part) for part in re.findall(r"[0-9.]+", text)] == pytest.approx(mm, rel=0.005)


def test_coverage_by_hand():
    rows = [("high", "event", 91.4, 85.0, 97.6), ("low", "rgb", 72.0, 72.0, 72.0)]
    covered = pd.DataFrame(rows, columns=["light", "modality", "inside_95_percent", "low", "high"])
    table = tables.of_coverage(covered)
    assert table.loc["events", "high light"] == "91 (85 to 98)"
    assert table.notna().sum().sum() == 2 and table.shape == (3, 3)


def test_saturation_stands_beside_the_papers():
    rows = [("high", 3.0, 30.0, 0.3), ("low", 1.0, 10.0, 0.1), ("medium", 2.0, 20.0, 0.2)]
    shares = pd.DataFrame(rows, columns=["light", "low", "high", "rank_correlation"])
    table = tables.of_saturation(shares, np.arange(6).reshape(3, 2)).data
    assert table.loc["medium light"].tolist() == [2, 2, 3, 20, 0.2]
    assert table.columns.get_level_values(1).tolist() == ["paper", "ours", "paper", "ours", "with the error"]


def test_filters_stand_by_light_each_with_its_own_numbers():
    of = product(("low", "high"), ("ring", "reflector"), ("rgb", "event"))
    rows = [(light, f, m, "low", 0.1 * k, 1.0 * k) for k, (light, f, m) in enumerate(of)]
    table = pd.DataFrame(rows, columns=["light", "filter", "modality", "domain_gap", "iou", "skeleton_px"])
    wide = tables.of_filters(table).data
    assert wide.shape == (4, 4)
    for light, f, m, gap, iou, skeleton_px in rows:
        assert wide.loc[(gap, f, m), ("IoU", light)] == iou
        assert wide.loc[(gap, f, m), ("skeleton (px)", light)] == skeleton_px


def test_no_name_of_the_code_is_left(compared):
    page = tables.html(tables.small_intervals(tables.of_accuracy(compared)))
    shown = re.sub(r"<[^>]*>", "", page)
    assert "found, ring in view" in shown and "_" not in shown


def test_a_styled_table_has_the_same_bytes_each_time_and_identifiers_of_its_own():
    one, other = pd.DataFrame({"a": [1.0, 2.0]}), pd.DataFrame({"a": [1.0, 3.0]})
    assert one.style.to_html() != one.style.to_html()  # pandas draws a new identifier
    assert tables.html(one.style) == tables.html(one.style)
    identifiers = [tables.html(t.style).split('<table id="')[1].split('"')[0] for t in (one, other)]
    assert len(set(identifiers)) == 2


def test_claims_lose_no_column():
    claims = pd.DataFrame(
        [["It is so", "1 | 2", "printed 3; 4; ours 5; 6", "holds", "a `rule`"]], columns=COLUMNS
    )
    page = tables.html(tables.of_claims(claims))
    assert all(
        part in page
        for part in ("It is so", "a <code>rule</code>", "1 | 2", "printed 3; 4<br>ours 5; 6", "holds")
    )
    assert "why" not in tables.text(tables.of_claims(claims))


def test_every_status_has_its_words():
    assert set(tables.ANSWERS) == {str(status) for status in Status}


def test_fusion_by_hand():
    rows = [
        ("low", "position_error_m", "event", -1.5e-3, -2e-3, 2.5e-4),
        ("high", "normal_error_deg", "rgb", 0.5, 0, 1),
    ]
    apart = pd.DataFrame(rows, columns=["light", "metric", "better", "difference", "low", "high"])
    table = tables.of_fusion(apart)
    assert table.loc[("low light", "position (mm)")].tolist() == ["events", "-1.50 (-2.00 to +0.25)"]
    assert table.loc[("high light", "normal (°)")].tolist() == ["frames", "+0.50 (+0.00 to +1.00)"]
