"""Table and figure of networks of several widths say what the committed results say."""

import pandas as pd
import pytest

from lmmap_lab.pages import widths_page
from lmmap_lab.provenance import DATA


@pytest.fixture
def widths():
    return pd.read_csv(DATA / "results" / "widths.csv")


def test_every_set_has_a_row_with_the_numbers_of_both_cameras(widths):
    table = widths_page.table(widths)
    assert len(table) == widths["set"].nunique() and table.notna().all(axis=None)
    half = widths.set_index(["set", "modality"]).loc["2-taught-seed1"]
    row = table.loc["half", "the same, second seed"]
    for modality, camera in (("rgb", "frames"), ("event", "events")):
        assert row[camera, "right (%)"].startswith(f"{half.right_percent[modality]:.0f} (")
        assert float(row[camera, "marker overlap"]) == pytest.approx(
            half.reflector_iou_high[modality], abs=0.005
        )
    assert float(row["cost", "GFLOP"]) == pytest.approx(2 * half.gmacs["rgb"], abs=0.005)


def test_a_half_of_the_width_has_a_quarter_of_the_operations_of_all_but_the_ends(widths):
    """Between two hidden layers operations grow with the square of the width, at first and last with it."""
    costs = widths[widths.modality == "rgb"].set_index("set")
    for wide, narrow in (("1", "2"), ("2", "4"), ("4", "8")):
        for what in ("parameters", "gmacs"):
            assert 1 / 4 < costs[what][narrow] / costs[what][wide] < 1 / 2


def test_the_figure_shows_every_network_of_equal_steps_once(widths):
    fig = widths_page.draw(widths)
    shown = widths[widths["set"] != "further"]
    for column, modality in enumerate(("rgb", "event")):
        own = shown[shown.modality == modality]
        for row, what in enumerate(("right_percent", "ring_iou_high")):
            lines = [bars.lines[0] for bars in fig.axes[2 * row + column].containers]
            assert sorted(y for line in lines for y in line.get_ydata()) == sorted(own[what])


def test_one_network_stands_beside_the_two_of_slim():
    joint = pd.read_csv(DATA / "results" / "joint.csv")
    table = widths_page.beside_slim(joint)
    own = joint.query("set == 'joint' and modality == 'event' and light == 'high'").iloc[0]
    assert table.shape == (6, 8) and table.notna().all(axis=None)
    row = table.loc["events", "high light"]
    assert row["right (%)", "joint"].startswith(f"{own.right_percent:.1f} (")
    assert float(row["marker overlap", "joint"]) == pytest.approx(own.reflector_iou, abs=0.005)
