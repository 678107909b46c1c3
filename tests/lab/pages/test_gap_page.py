"""Figures of accuracy: each mark stands where its table says."""

import numpy as np
import pandas as pd
import pytest

from lmmap.settings import MODALITIES
from lmmap_lab.pages import gap_page
from lmmap_lab.studies import domain_gap
from lmmap_lab.studies.table1 import LIGHTS


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
    assert table.loc[("overlap of the masks", "mean"), "frames minus events"] == "0.10 (0.10 to 0.10)"
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
