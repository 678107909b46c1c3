"""The accuracy chapter's tables: each number where it belongs."""

from itertools import product

import numpy as np
import pandas as pd
import pytest

from lmmap_lab.pages import accuracy_page, tables
from lmmap_lab.studies.verdicts import row


def test_differences_are_counted(compared):
    ends = dict(ours_low=compared.table1, ours_high=compared.table1 + 1)
    counts = accuracy_page.difference_counts(compared.assign(ours=compared.table1 + 0.5, **ends)).data
    assert counts["low domain gap", "alike"].tolist() == [6] * (len(tables.WORDS) - 1)
    ends = dict(ours_low=compared.table1 + 1, ours_high=compared.table1 + 3)
    counts = accuracy_page.difference_counts(compared.assign(ours=compared.table1 + 2, **ends)).data
    counts = counts["low domain gap"]
    rates = counts.index.str.startswith("found")  # more of these is better, of an error it is worse
    assert counts.better.tolist() == (6 * rates).tolist() and counts.worse.tolist() == (6 * ~rates).tolist()


def test_an_ellipse_without_markers_is_found_as_the_paper_counts(compared):
    cells = compared[["training", "light", "modality"]].drop_duplicates()
    answers = cells.merge(
        pd.DataFrame({"status": ["ok", "no_markers", "no_ring"], "in_view": [5, 4, 1]}), "cross"
    )
    rates = accuracy_page.detection_rates(answers, compared).data["low light", "frames"].loc["low domain gap"]
    paper = compared.query("light == 'low' and modality == 'rgb' and statistic == 'in_fov'").table1.item()
    assert rates.tolist() == pytest.approx([paper, 2 * paper, 90])


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
    table = accuracy_page.sequence_table(pd.DataFrame(rows, columns=names)).data
    assert table.index.tolist() == list(product(["test-low-0", "test-low-1"], tables.CAMERAS.values()))
    assert table.loc[("test-low-1", "fused")].tolist() == [2, 1, 99, 90]


def test_the_default_networks_table_has_the_lights_and_no_image_without_a_port():
    names = ["light", "modality", "right_percent", "wrong_percent", "none_percent", "images",
             "position_error_m", "normal_error_deg", "rotation_error_deg", "inside_95_percent"]  # fmt: skip
    rows = [("high", "event", 90, 1, 9, 60, 0.0015, 0.5, 0.7, 94), ("no port", "event", *[np.nan] * 8)]
    table = accuracy_page.default_table(pd.DataFrame(rows, columns=names)).data
    assert table.index.tolist() == [("high light", "events")]
    assert table.iloc[0].tolist() == [90, 1, 9, 1.5, 0.5, 94]
    other = pd.DataFrame([("high", "event", 80, 2, 18, 60, 0.002, 0.5, 0.7, 94)], columns=names)
    both = accuracy_page.sets_table({"a": pd.DataFrame(rows, columns=names), "b": other}).data
    assert both.loc["high light", "events"].tolist() == [90, 80, 1, 2, 1.5, 2.0]
    assert both["wrong (%)"].columns.tolist() == ["a", "b"]


def test_coverage_by_hand():
    rows = [("high", "event", 91.4, 85.0, 97.6), ("low", "rgb", 72.0, 72.0, 72.0)]
    covered = pd.DataFrame(rows, columns=["light", "modality", "inside_95_percent", "low", "high"])
    table = accuracy_page.coverage_table(covered)
    assert table.loc["events", "high light"] == "91 (85 to 98)"
    assert table.notna().sum().sum() == 2 and table.shape == (3, 3)


def test_saturation_stands_beside_the_papers():
    rows = [("high", 3.0, 30.0, 0.3), ("low", 1.0, 10.0, 0.1), ("medium", 2.0, 20.0, 0.2)]
    shares = pd.DataFrame(rows, columns=["light", "low", "high", "rank_correlation"])
    table = accuracy_page.saturation_table(shares, np.arange(6).reshape(3, 2)).data
    assert table.loc["medium light"].tolist() == [2, 2, 3, 20, 0.2]
    assert table.columns.get_level_values(1).tolist() == ["paper", "ours", "paper", "ours", "with the error"]


def test_claims_lose_no_column():
    cells = {"printed": ("3; 4", "partly"), "ours": ("5; 6", "holds")}
    claims = pd.DataFrame([row("not_hdr", "1 | 2", cells, "a `rule`", decides="ours")])
    page = tables.to_html(accuracy_page.claims_table(claims))
    parts = (
        "This rejects the HDR difference hypothesis",
        "Numbers: position, median",
        "Holds if: a <code>rule</code>",
        "cause",
        "1 | 2",
        "partly<br><small>3; 4",
        "<b>holds</b><br><small>5; 6",
    )
    assert all(part in page for part in parts) and "not run" not in page
    assert "why" not in tables.to_text(accuracy_page.claims_table(claims))


def test_tables_of_an_earlier_estimator_say_so():
    assert "made at abc, with the present estimator" in accuracy_page.when_made("abc", [])
    text = accuracy_page.when_made("abc", ["test-low"])
    assert "made at abc;" in text and "changed since" in text
