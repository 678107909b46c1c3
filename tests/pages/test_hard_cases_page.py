"""The hard cases' tables, by hand."""

import numpy as np
import pandas as pd

from lmmap.pages import hard_cases_page


def test_hard_cases_by_hand():
    index = pd.MultiIndex.from_product([["hard-slow", "test-low"], ["rgb", "fused"]])
    counts = pd.DataFrame({"images": 40, "ellipses": [30, 0, 9, 9], "poses": [20, 40, 9, 9]}, index)
    counts = counts.assign(position_error_m=2e-3, normal_error_deg=[3.0, np.nan, 1, 1])
    table = hard_cases_page.hard_case_table(counts, {"hard-slow": "slow motion"}).data
    assert table.index.tolist() == [("slow motion", "frames"), ("slow motion", "fused")]
    assert table.loc[("slow motion", "frames")].tolist() == [100, 75, 50, 40, 2, 3]
    assert table["ellipse, ours (%)"].isna().tolist() == [False, True]


def test_fusion_by_hand():
    rows = [
        ("low", "position_error_m", "event", -1.5e-3, -2e-3, 2.5e-4),
        ("high", "normal_error_deg", "rgb", 0.5, 0, 1),
    ]
    apart = pd.DataFrame(rows, columns=["light", "metric", "better", "difference", "low", "high"])
    table = hard_cases_page.fusion_table(apart)
    assert table.loc[("low light", "position (mm)")].tolist() == ["events", "-1.50 (-2.00 to +0.25)"]
    assert table.loc[("high light", "normal (°)")].tolist() == ["frames", "+0.50 (+0.00 to +1.00)"]
