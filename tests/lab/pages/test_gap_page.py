"""Figures of accuracy: each mark stands where its table says."""

from itertools import product

import numpy as np
import pandas as pd
import pytest

from lmmap.settings import MODALITIES
from lmmap_lab.pages import gap_page
from lmmap_lab.studies.table1 import LIGHTS


@pytest.fixture
def gap():
    """Medians of 1, 2, 3 m and shares of 30, 60, 90 % in the three lights; the paper's are twice as much."""
    rows = []
    for (metric, statistic), m, (k, light) in product(
        (("position_error_m", "median"), ("detection_rate_percent", "in_fov")), MODALITIES, enumerate(LIGHTS)
    ):
        ours = (k + 1) * (1.0 if metric == "position_error_m" else 30.0)
        rows.append((metric, statistic, m, light, ours, ours - 0.5, ours + 0.25, 2 * ours))
    names = ["metric", "statistic", "modality", "light", "ours", "ours_low", "ours_high", "table1"]
    return pd.DataFrame(rows, columns=names)


def test_both_gaps_stand_beside_the_paper_in_millimetres_and_percent(gap):
    axes = np.reshape(gap_page.draw_gap(gap, gap.assign(ours=7.0)).axes, (2, 2))
    diamonds = [[line for line in ax.lines if line.get_marker() == "D"] for ax in axes.flat]
    assert all(np.array_equal(line.get_ydata(), [2000, 4000, 6000]) for line in (*diamonds[0], *diamonds[1]))
    ours, *_ = axes[1, 0].containers
    assert np.array_equal(ours.lines[0].get_ydata(), [30, 60, 90])
    ends = np.array(ours.lines[2][0].get_segments())[..., 1]
    np.testing.assert_allclose(ends, [[29.5, 30.25], [59.5, 60.25], [89.5, 90.25]])
    assert set(axes[1, 1].containers[0].lines[0].get_ydata()) == {7.0}


def test_the_cost_of_a_gap_is_a_line_from_the_low_to_the_high_gap():
    index = pd.MultiIndex.from_product([LIGHTS, MODALITIES])
    rate = pd.DataFrame({"low-domain-gap": 90.0, "high-domain-gap": np.arange(6.0)}, index)
    cost = pd.DataFrame({"error grows by": np.arange(6.0) + 1}, index)
    left, right = gap_page.draw_gap_cost(rate, cost).axes
    spans = [line.get_ydata() for line in left.lines if len(line.get_ydata()) == 2]
    assert np.array_equal(spans, [(90, k) for k in range(6)])
    assert [text.get_text() for text in left.get_legend().get_texts()] == ["frames", "events"]
    assert [line.get_ydata()[0] for line in right.lines[:6]] == [1, 2, 3, 4, 5, 6]


def test_errors_as_promised_lie_on_the_lines():
    """Half of a normal variable's magnitudes are below 0.674 standard deviations, 95 % below 1.960."""
    predicted = np.array([0.001, 0.01])
    tables = [pd.DataFrame({"what": what, "modality": "rgb", "predicted": predicted,
                            "error": 0.67449 * predicted, "most": 1.95996 * predicted})
              for what in ("position_m", "normal_deg")]  # fmt: skip
    for ax in gap_page.draw_promise(pd.concat(tables)).axes:
        dots, triangles = ax.lines[:2]
        half, most = ax.lines[-2:]
        for marks, line in ((dots, half), (triangles, most)):
            slopes = [drawn.get_ydata() / drawn.get_xdata() for drawn in (marks, line)]
            np.testing.assert_allclose(*slopes, rtol=1e-4)
