"""The drawing of the port's fit shows what the outlines hold."""

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.collections import LineCollection, PolyCollection

from lmmap.types import Port
from lmmap_lab.pages import drawings, port_fit
from lmmap_lab.provenance import DATA, load_json


def test_a_drawing_shows_each_pixel_and_each_line():
    outlines = {
        "a": {"lines": "10,20 11,20 12,21", "windows": "30,40", "model": ["10,20 30,40 10,40", "12,21 13,22"]}
    }
    fig = port_fit.draw_fit(outlines, {"a": "a picture"})
    (ax,) = fig.axes
    squares = next(c for c in ax.collections if isinstance(c, PolyCollection))
    centres = [path.vertices[:4].mean(0) for path in squares.get_paths()]
    np.testing.assert_allclose(centres, [[10, 20], [11, 20], [12, 21], [30, 40]])
    lines = next(c for c in ax.collections if isinstance(c, LineCollection))
    assert [len(segment) for segment in lines.get_segments()] == [3, 2]
    assert ax.get_xlim() == (6, 34) and ax.get_ylim() == (44, 16)
    plt.close(fig)


def test_the_committed_outlines_are_described_and_the_model_runs_through_the_pixels():
    outlines = load_json(DATA / "results" / "port-outlines.json")
    fig = port_fit.draw_fit(outlines, {name: name for name in outlines})
    assert len(fig.axes) == len(outlines) == 2
    assert "wireframe model" in {ax.get_label() for ax in fig.axes}.pop()
    assert all(name in drawings.describe(fig) for name in outlines)
    for outline in outlines.values():
        pixels = port_fit._points(outline["lines"])
        model = [port_fit._points(line) for line in outline["model"]]
        t = np.linspace(0, 1, 40)[:, None, None]
        near = np.concatenate([(a + t * (b - a)).reshape(-1, 2) for line in model
                               for a, b in ((line[:-1], line[1:]),)])  # fmt: skip
        off_px = np.array([np.hypot(*(near - pixel).T).min() for pixel in pixels])
        assert np.median(off_px) < 0.5
    plt.close(fig)


def test_the_port_is_the_measured_one_but_for_the_length_of_its_markers():
    """All lengths but that one lie in the committed 95 % intervals."""
    port, measured = Port.lm_map(), pd.read_csv(DATA / "results" / "port.csv").set_index("dimension")
    (length, width), (tangential, radial) = port.marker_size_m, port.window_size_m
    ours_m = {
        "ring_inner": port.ring_inner_radius_m, "plate_height": port.plate_height_m,
        "marker_inner": port.marker_radius_m - width / 2, "marker_outer": port.marker_radius_m + width / 2,
        "marker_half_length": length / 2, "plate_circumradius": port.plate_circumradius_m,
        "window_centre": port.window_radius_m, "window_half_radial": radial / 2,
        "window_half_tangential": tangential / 2, "petal_rise": port.petal_rise_m,
        "petal_lean": port.petal_lean_m, "petal_half_width_at_plate": port.petal_widths_m[0] / 2,
        "petal_half_width_at_tip": port.petal_widths_m[1] / 2,
    }  # fmt: skip
    ours_mm = 1e3 * pd.Series(ours_m).reindex(measured.index)
    outside = (ours_mm < measured.mm_low) | (ours_mm > measured.mm_high)
    assert list(measured.index[outside]) == ["marker_half_length"]
