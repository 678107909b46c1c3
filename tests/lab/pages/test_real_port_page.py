"""Outlines of what was found, and the table that says whether it is right."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from lmmap.pipeline.weights import DOMAIN_GAPS
from lmmap.types import Port
from lmmap_lab.pages import real_port_page


def test_a_drawing_shows_the_ring_by_hand_and_the_ellipse_widened_to_its_edge():
    fitted = {"ellipse": [50, 40, 20, 15, 0.0], "mask": ["30,30 60,30 60,50"], "status": "ok"}
    lost = {"ellipse": None, "mask": [], "status": "no_ring"}
    outlines = {"a": {"outer": [50, 40, 22, 16, 0.0], "high": fitted, "low": fitted, "robust": lost}}
    fig = real_port_page.draw_outlines(outlines, {"a": "a picture"})
    assert [ax.get_title() for ax in fig.axes] == ["a picture\nhigh", "low", "robust"]
    assert [len(ax.lines) for ax in fig.axes] == [2, 2, 1]
    width = np.ptp(fig.axes[0].lines[1].get_xdata())
    port = Port.lm_map()
    np.testing.assert_allclose(width, 40 * port.ring_outer_radius_m / port.ring_radius_m, rtol=1e-3)


def test_the_table_tells_right_from_wrong_and_from_nothing():
    rows = pd.DataFrame({
        "picture": "a", "filters": DOMAIN_GAPS[:3], "status": ["ok", "unsure", "no_ring"],
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
