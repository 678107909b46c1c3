"""The drawing of the port's fit shows what the outlines hold."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection, PolyCollection

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
    assert "wire model" in {ax.get_label() for ax in fig.axes}.pop()
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
