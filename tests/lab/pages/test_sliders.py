"""Figures that move: each step shows what its label says, and paper gets a still."""

import base64
import re
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from strategies import facing_pose

from lmmap.geometry.conics import circle_ellipse
from lmmap.geometry.port import ideal_masks
from lmmap.pipeline import ellipse
from lmmap.types import EVENT, Ellipse
from lmmap_lab.pages import ellipses_page, histograms_page, networks_page, sliders


@pytest.fixture
def ring(camera, port):
    T = facing_pose(0.5, 0.3, 0.1, [0.0, 0.0, 0.5])
    return ideal_masks(T, port, camera)[0], circle_ellipse(T, port.ring_radius_m, camera)


def test_windows_end_with_the_same_event_and_hold_as_many_as_they_say(camera, rng):
    events = np.zeros(5000, EVENT)
    events["t_us"], events["x"], events["y"] = np.arange(5000) * 10, rng.integers(346, size=5000), 7

    def outline_px(t_us):
        return np.full((3, 2), t_us * 1e-3)

    steps = histograms_page.window_steps(events, (100, 5000), camera, outline_px)
    assert [step.label for step in steps] == ["100", "5,000"]
    first_px, last_px = ([curve[1] for curve in step.curves] for step in steps)
    np.testing.assert_array_equal(first_px[1], last_px[1])
    assert "50.0 ms" in steps[1].title and (last_px[1] - last_px[0]).max() == pytest.approx(49.99)
    assert all(np.count_nonzero(step.image[:7]) == 0 < step.image[7].sum() for step in steps)


def test_five_drawn_points_lie_on_their_conic_and_the_answer_on_most(ring, rng):
    mask, truth = ring
    points = np.vstack([truth.points(90), rng.uniform(0, 250, (40, 2))])
    steps = ellipses_page.ransac_steps(mask, points, 30, rng)
    assert len(steps) == 31
    counted = []
    for step in steps[:-1]:
        off, on, contour, five = (curve[1] for curve in step.curves)
        assert len(off) + len(on) == len(points) and len(five) == 5
        if len(contour):
            assert {tuple(p) for p in np.unique(five, axis=0)} <= {tuple(p) for p in on}
        counted.append(len(on))
    assert f"best so far {max(counted)}" in steps[-2].title
    assert len(steps[-1].curves[1][1]) >= 90


def test_half_an_ellipse_has_its_wrong_points_and_no_others_off_one_half(camera, rng):
    drawn, points = ellipses_page.half_ellipse(0.4, camera, rng, count=100, noise_px=0.0)
    near = np.linalg.norm(points[:, None] - drawn.points(3600), axis=-1).min(1) < 1e-6
    assert near[:60].all() and near[60:].sum() < 5
    assert ellipse.arc_coverage(drawn, points[:60]) <= 0.52


def test_a_high_threshold_refuses_and_a_sensible_one_finds(ring, rng):
    mask, truth = ring
    (low, high), off_px = networks_page.threshold_steps(mask * 0.9, [0.5, 0.95], truth, rng)
    assert off_px[0] < 1 and np.isinf(off_px[1])
    assert "no ellipse" in high.title and high.title.startswith("0 ")
    assert "100 % of the contour" in low.title and low.image.sum() > 0 == high.image.sum()


@pytest.mark.parametrize("start", [0, 2])
def test_the_slider_shows_one_step_and_the_still_is_it(ring, start):
    images = [np.full((260, 346), shade) for shade in (0.0, 0.5, 1.0)]
    steps = [sliders.Step(f"{k}", f"title <{k}>", image, (("dot", [[k, k]], "ours", "markers"),
                              ("line", Ellipse([90, 90], [9, 9], 0).points(), "truth", "lines")))
             for k, image in enumerate(images)]  # fmt: skip
    bundle = sliders.Slider(steps, "k", start)._repr_mimebundle_()
    tree = ElementTree.fromstring(bundle["text/html"])
    views = tree.findall("div[@class='step']")
    assert [view.get("data-label") for view in views] == ["0", "1", "2"]
    assert [view.get("hidden") is None for view in views] == [k == start for k in range(3)]
    assert [view.find("p").text for view in views] == [f"title <{k}>" for k in range(3)]
    slider = tree.find("label/input")
    assert (slider.get("value"), slider.get("max"), slider.get("aria-valuetext")) == (
        f"{start}",
        "2",
        f"{start}",
    )
    png = cv2.imdecode(np.frombuffer(base64.b64decode(bundle["image/png"]), np.uint8), cv2.IMREAD_COLOR)
    middle = png[png.shape[0] // 2, png.shape[1] // 2].astype(float)
    assert np.abs(middle - 255 * images[start][0, 0]).max() < 3


def test_a_line_breaks_where_a_point_is_missing_and_dots_are_apart():
    points = [[0, 0], [1, 0], [np.nan, np.nan], [2, 2], [3, 2]]
    curves = (("line", points, "ours", "lines"), ("dots", points, "truth", "markers"))
    html = sliders.Slider([sliders.Step("a", "b", np.zeros((4, 4)), curves)], "k").html()
    line, dots = re.findall(r'<path d="([^"]*)"', html)
    assert line == "M0.0 0.0L1.0 0.0M2.0 2.0L3.0 2.0"
    assert dots.count("M") == dots.count("h0") == 4 and "L" not in dots


def test_an_image_that_steps_share_is_written_once_and_where_the_slider_starts():
    dark, light = np.zeros((4, 4)), np.ones((4, 4))
    steps = [sliders.Step(f"{k}", "", image, ()) for k, image in enumerate([dark, dark, light])]
    tree = ElementTree.fromstring(sliders.Slider(steps, "k", start=1).html())
    images, uses = ([view.findall(f"svg/{tag}") for view in tree.findall("div")] for tag in ("image", "use"))
    assert [len(nodes) for nodes in images] == [0, 1, 1] and [len(nodes) for nodes in uses] == [1, 0, 0]
    assert uses[0][0].get("href") == "#" + images[1][0].get("id")


def test_a_strip_hides_no_step_before_its_script_runs_and_writes_a_shared_image_once():
    frame, line = np.zeros((6, 8, 3)), (("line", [[1, 1], [2, 2]], "truth", "lines"),)
    steps = [sliders.Step(f"{k}", f"title {k}", frame, line) for k in range(3)]
    tree = ElementTree.fromstring(sliders.Strip(steps, "step").html().split("<script>")[0])
    views = tree.findall("div/div[@class='step']")
    assert [view.get("hidden") for view in views] == [None] * 3
    assert len(list(tree.iter("image"))) == 1 and len(list(tree.iter("use"))) == 2
    assert tree.find("div/label").get("hidden") is not None
