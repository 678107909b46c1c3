"""Outlines of what was found, and the table that says whether it is right."""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from lmmap.pipeline.weights import SETS
from lmmap.recordings.formats import open_recording
from lmmap.types import Estimate, Port, Status
from lmmap_lab.pages import real_port_page
from lmmap_lab.provenance import DATA


def test_a_drawing_shows_the_ring_by_hand_and_the_ellipse_widened_to_its_edge():
    fitted = {"ellipse": [50, 40, 20, 15, 0.0], "mask": ["30,30 60,30 60,50"], "status": "ok"}
    lost = {"ellipse": None, "mask": [], "status": "no_ring"}
    outlines = {"a": {"outer": [50, 40, 22, 16, 0.0], "high": fitted, "low": fitted, "robust": lost}}
    fig = real_port_page.draw_outlines(outlines, {"a": "a picture"})
    assert [ax.get_title() for ax in fig.axes] == ["a picture\nhigh gap", "low gap", "default"]
    assert [len(ax.lines) for ax in fig.axes] == [2, 2, 1]
    width = np.ptp(fig.axes[0].lines[1].get_xdata())
    port = Port.lm_map()
    np.testing.assert_allclose(width, 40 * port.ring_outer_radius_m / port.ring_radius_m, rtol=1e-3)


def test_the_table_tells_right_from_wrong_and_from_nothing():
    rows = pd.DataFrame({
        "picture": "a", "filters": SETS[:3], "status": ["ok", "unsure", "no_ring"],
        "contrast": [0.5, 0.4, np.nan], "ring_right": [True, False, False], "centre_px": [1.24, 30, np.nan],
        "major_ratio": [1, 2, np.nan], "pose_plausible": [True, False, False],
    })  # fmt: skip
    what = pd.DataFrame({"what": ["the picture"]}, index=["a"])
    table = real_port_page.found_table(rows, what)
    assert list(table.loc["the picture"]) == ["ring, 1.2 px off, pose", "a wrong ring", "no ring"]


def test_the_chain_names_its_four_frames_and_dashes_only_what_is_unknown():
    fig, ax = plt.subplots()
    real_port_page.draw_chain(ax)
    words = {text.get_text() for text in ax.texts}
    assert {"camera", "arm's base", "flange", "port"} <= words
    arrows = [text for text in ax.texts if getattr(text, "arrow_patch", None)]
    dashed = [text.xy for text in arrows if text.arrow_patch.get_linestyle() == "--"]
    assert len(arrows) == 4 and len(dashed) == 1
    plt.close(fig)


def test_found_rings_and_poses_are_counted_by_set():
    rows = pd.DataFrame({
        "picture": ["a", "b", "unseen"] * 6, "filters": np.repeat(SETS[:3], 6),
        "local_search": np.tile(np.repeat([False, True], 3), 3), "ring_right": [True, False, True] * 6,
        "status": ["ok", "ok", "no_ring"] * 3 + ["unsure"] * 9,
    })  # fmt: skip
    table = real_port_page.found_counts(rows, ["a", "b"])
    assert table.loc["high gap"].tolist() == [1, 1, 2, 1]
    assert table.loc["default"].tolist() == [1, 1, 0, 0]


def test_a_cad_as_the_port_s_draws_its_markers_where_they_are():
    recording, port = open_recording(DATA / "mini" / "test-low.aedat4"), Port.lm_map()
    t_us = int(recording.frames_t_us[3])
    exact = Estimate(
        t_us, Status.OK, recording.truth.at(np.array([t_us]))[0], confidence=0.5, markers_off_px=0.0
    )
    right = real_port_page.judge_cad(recording, [exact], port, port)
    assert right["drawn marker error (px)"] < 1e-6 and right["position error (mm)"] < 1e-6
    wrong = real_port_page.judge_cad(recording, [exact], replace(port, plate_height_m=0.046), port)
    assert wrong["drawn marker error (px)"] > 0.5 and wrong["confidence"] == 0.5
