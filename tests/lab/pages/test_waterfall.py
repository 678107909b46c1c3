"""The waterfall: means over lights by hand, and a bar for each rung and camera."""

from itertools import product

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from lmmap.types import Camera, Port
from lmmap_lab.pages import accuracy_page, waterfall
from lmmap_lab.studies import formula
from lmmap_lab.studies.ladder import RUNGS
from lmmap_lab.studies.table1 import LIGHTS

METRICS = {"normal_error_deg": "median", "position_error_m": "median", "wrong_percent": "in_fov",
           "detection_rate_percent": "in_fov"}  # fmt: skip


@pytest.fixture
def rungs():
    """Cell k of rung r has the value 10 r + light's index, for events one more."""
    cells = product(enumerate(RUNGS), METRICS.items(), enumerate(LIGHTS), enumerate(("rgb", "event")))
    rows = [
        (rung, metric, statistic, light, m, 10.0 * r + i + k)
        for (r, rung), (metric, statistic), (i, light), (k, m) in cells
    ]
    table = pd.DataFrame(rows, columns=["rung", "metric", "statistic", "light", "modality", "value"])
    rmse = table[table.metric == "position_error_m"].assign(statistic="rmse")
    table = pd.concat([table, rmse])
    return table.assign(training="low-domain-gap", outlier_filter="without")


def test_means_over_lights_by_hand(rungs):
    table = waterfall.means(rungs, "low")
    assert list(table.index.get_level_values("rung").unique()) == list(RUNGS)
    assert table.loc[("as printed", "rgb"), "normal, median error (°)"] == pytest.approx(1.0)
    assert table.loc[("robust ellipse", "event"), "position, median error (mm)"] == pytest.approx(12e3)


def test_each_rung_has_its_bars_and_numbers(rungs):
    readings = {"ends": 4.0, "true centre": 2.0}
    fig = waterfall.draw(rungs, readings=readings)
    assert [label.get_text() for label in fig.axes[0].get_yticklabels()] == list(RUNGS)
    marks = [line.get_xdata()[0] for line in fig.axes[0].lines]
    assert marks == list(readings.values()) and not fig.axes[1].lines
    for ax, more in zip(fig.axes, (len(readings), 0, 0), strict=True):
        assert len(ax.patches) == 2 * 2 * len(RUNGS) and len(ax.texts) == 2 * len(RUNGS) + more
    plt.close(fig)


def test_the_other_readings_err_less_than_the_printed_one():
    camera, port = Camera.davis346(), Port.lm_map()
    printed_rad = formula.errors_rad(formula.bench_poses(camera, port), camera, port.ring_radius_m, "printed")
    others = waterfall.readings_deg()
    assert set(others) == set(formula.READINGS) - {"printed"}
    assert max(others.values()) < np.rad2deg(np.median(printed_rad))


def test_the_ladder_s_table_has_every_rung_under_every_number(rungs):
    table = accuracy_page.ladder_table(rungs).data
    assert table.shape == (4 * len(RUNGS), 6) and table.notna().all(axis=None)
    assert table.loc[("normal (°)", "as printed"), ("high light", "events")] == 3
    assert table.loc[("position, RMSE (mm)", "as printed"), ("low light", "frames")] == 0
