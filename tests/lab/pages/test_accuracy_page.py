"""The accuracy chapter's tables: each number where it belongs."""

import numpy as np
import pandas as pd

from lmmap_lab.pages import accuracy_page, tables
from lmmap_lab.studies.verdicts import row


def test_the_gap_s_table_has_the_paper_and_ours_with_each_set(compared):
    rates = compared[compared.metric == "detection_rate_percent"].assign(metric="wrong_percent")
    compared = pd.concat([compared, rates])
    high, low = (compared.assign(table1=v, ours=v + 1, ours_low=v, ours_high=v + 2) for v in (0.01, 0.02))
    table = accuracy_page.gap_table(high, low)
    who = [f"{name}, {gap} gap" for gap in ("high", "low") for name in ("paper", "ours")]
    of_ours = ["ours, high gap", "ours, low gap"]  # the paper states no wrong poses
    rows = [("position (mm)", who), ("found, ring in view (%)", who), ("wrong, ring in view (%)", of_ours)]
    assert table.index.tolist() == [(title, name) for title, names in rows for name in names]
    assert (table.loc[("position (mm)", "paper, high gap")] == "10").all()
    assert (table.loc[("found, ring in view (%)", "ours, low gap")] == "1.0 (0.0 to 2.0)").all()


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


def test_claims_lose_no_column():
    cells = {"printed": ("3; 4", "partly"), "ours": ("5; 6", "holds")}
    claims = pd.DataFrame([row("not_hdr", "1 | 2", cells, "a `rule`", decides="ours")])
    page = tables.to_html(accuracy_page.claims_table(claims))
    parts = (
        "This rejects the HDR difference hypothesis",
        "Numbers: median position error (mm)",
        "Holds if: a <code>rule</code>",
        "(cause)",
        "1 and 2",
        "partly<br><small>3; 4",
        "<b>holds</b><br><small>5; 6",
    )
    assert all(part in page for part in parts) and "not run" not in page
    assert "why" not in tables.to_text(accuracy_page.claims_table(claims))


def test_tables_of_an_earlier_estimator_say_so():
    assert accuracy_page.when_made([]) == "made with the current estimator and networks"
    assert "made before the estimator" in accuracy_page.when_made(["test-low"])
