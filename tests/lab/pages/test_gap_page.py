"""Figures of accuracy: each mark stands where its table says."""

from itertools import product

import numpy as np
import pandas as pd
import pytest

from lmmap.settings import MODALITIES
from lmmap_lab.pages import gap_page
from lmmap_lab.studies import domain_gap
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


@pytest.fixture
def costs():
    """Frames lose 0.2 in each light and events 0.1; both sets and *robust* are there."""
    images = pd.DataFrame([
        {"place": "film", "light": light, "sequence": f"{light}{k}", "modality": m, "set": name, "seed": seed,
         **dict.fromkeys(domain_gap.MEASURES, 0.9 - (name == "high") * {"rgb": 0.2, "event": 0.1}[m])}
        for light in LIGHTS for k in range(4) for m in MODALITIES for name in ("high", "low", "robust")
        for seed in range(1 if name == "robust" else 3)
    ])  # fmt: skip
    return domain_gap.table(images, 50)


def test_the_cost_of_a_gap_stands_by_light_camera_and_seed(costs):
    for ax, (_, scale) in zip(gap_page.draw_costs(costs).axes, gap_page.MEASURES.values(), strict=True):
        frames, events = (bar.lines[0].get_ydata().astype(float) for bar in ax.containers)
        np.testing.assert_allclose(frames, 0.2 * scale)
        np.testing.assert_allclose(events, 0.1 * scale)
        assert len([line for line in ax.lines if line.get_marker() == "x"]) == 2 * 3


def test_the_table_of_costs_says_who_loses_less(costs):
    table = gap_page.cost_table(costs)
    assert table.loc[("overlap of the masks (IoU)", "mean"), "frames less events"] == "0.10 (0.10 to 0.10)"
    assert table.loc[("right rings (%)", "low"), "frames"] == "20 (20 to 20)"
    words = "events lose less than frames in low and medium and high light"
    assert gap_page.lights_in_words(costs, "film", "mask_overlap") == words
    (sets,) = gap_page.draw_sets(costs, "film").axes[0].containers[0].lines[:1]
    np.testing.assert_allclose(sets.get_ydata().astype(float), [0.7, 0.9, 0.9])


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
