"""The hard cases' tables and figure, by hand."""

import numpy as np
import pandas as pd

from lmmap_lab.bench.event_sensor import SensorSettings
from lmmap_lab.pages import hard_cases_page
from lmmap_lab.pages.tables import CAMERAS, LIGHTS


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


def test_each_panel_has_the_three_tracks_in_its_unit():
    metrics, names = [m for m, *_ in hard_cases_page.ERRORS], ["metric", "statistic", "light", "modality"]
    index = pd.MultiIndex.from_product([metrics, ["median"], LIGHTS, CAMERAS], names=names)
    cells = pd.DataFrame({"value": 2.0, "low": 1.0, "high": 2.5}, index)
    panels = hard_cases_page.draw_fused(cells).axes
    assert [set(ax.containers[0].lines[0].get_ydata()) for ax in panels] == [{2000.0}, {2.0}, {2.0}]
    assert all(len(ax.containers) == 3 for ax in panels)


def test_slow_motion_s_shares_stand_with_their_networks():
    counts = pd.DataFrame([("hard-slow", "event", 200, 150, 50)],
                          columns=["sequence", "modality", "images", "ellipses", "poses"])  # fmt: skip
    own = {"shot_hz": SensorSettings().shot_hz, "images": 100, "ellipse_percent": 90.0, "none_percent": 30.0,
           "right_percent": 65.0, "wrong_percent": 5.0}  # fmt: skip
    low, default = hard_cases_page.slow_shares(counts, pd.DataFrame([own])).to_numpy(float)
    assert low[:3].tolist() == [200, 75, 25] and np.isnan(low[3:]).all()
    assert default.tolist() == [100, 90, 70, 65, 5]
