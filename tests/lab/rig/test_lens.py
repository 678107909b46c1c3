"""A lens from views of the port: exact edges give it exactly, images within the interval that it states."""

import json
from collections import Counter
from dataclasses import replace

import cv2
import lens_coverage
import numpy as np
import pytest
from test_port_calibration import ExactEdges, disturbed, views

from lmmap.types import Camera, Port, Pose
from lmmap_lab.rig import port_views
from lmmap_lab.rig.lens import fit_lens
from lmmap_lab.rig.port_calibration import adjust, with_lens

LENS = np.array([0.07, -0.05, 0.004, -0.006])


def test_a_lens_differs_by_its_values(camera):
    assert with_lens(camera, LENS[:0]) == camera and with_lens(camera, LENS[:1]).distortion == ()
    other = with_lens(camera, LENS)
    assert other.fx_px / camera.fx_px == other.fy_px / camera.fy_px == pytest.approx(np.exp(0.07))
    assert other.distortion == (-0.05, 0, 0, 0) and other.cx_px - camera.cx_px == pytest.approx(0.004 * 346)
    twice = with_lens(other, -LENS)
    assert np.allclose(
        [twice.fx_px, twice.cx_px, twice.cy_px, *twice.distortion], [324, 172.5, 129.5, 0, 0, 0, 0]
    )


def test_exact_edges_give_the_lens(port, rng):
    """From a start that is 7 % off; what was known before pulls a little.  These edges know no distortion."""
    camera, lens = Camera(640, 480, 600, 600, 319.5, 239.5), LENS * [1, 0, 1, 1]
    true = replace(with_lens(camera, lens), distortion=())
    drawn = [lens_coverage.draw_pose(true, port, rng) for _ in range(24)]
    T = Pose(np.stack([T.rotation for T in drawn]), np.stack([T.position_m for T in drawn]))
    fit = adjust(disturbed(T, rng), ExactEdges(T, port, true), port, camera, 4, np.full(5, 1e-5))
    assert fit.settled and np.all(np.abs(fit.lens - lens) < [1e-3, 2e-3, 5e-4, 5e-4])


def test_an_image_has_its_edges_over_a_floor():
    """A step from 200 to 100 grey levels is seen in an image, while half of its peak is nowhere."""
    step = np.repeat(np.where(np.arange(40) < 20, 200.0, 100.0)[None], 30, 0).astype(np.float32)
    at, right = np.array([[18.0, 15]]), np.array([[1.0, 0]])
    assert port_views.half_height_px(step, at, right, 30.0, floor=True) == pytest.approx(1.5, abs=0.01)
    assert np.isnan(port_views.half_height_px(step, at, right, 30.0)[0])
    assert np.isnan(port_views.half_height_px(step, at, right, 101.0, floor=True)[0])


def test_a_simulated_clip_is_within_its_interval():
    found = lens_coverage.measure(0, views=16)
    assert abs(found["focal_error_percent"]) < 3 * found["focal_sigma_percent"] < 6
    assert abs(found["k1_error"]) < 3 * found["k1_sigma"] < 0.1


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """Eighteen views by a lens of 46 degrees, in a video."""
    path, rng = tmp_path_factory.mktemp("lens") / "clip.avi", np.random.default_rng(5)
    camera = Camera(480, 360, 560, 560, 241, 178, (-0.1, 0, 0, 0))
    video = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 5, camera.size_px)
    for _ in range(18):
        video.write(cv2.cvtColor(lens_coverage.draw_view(camera, Port.lm_map(), rng)[1], cv2.COLOR_GRAY2BGR))
    video.release()
    return path, camera


def test_a_clip_gives_a_file_that_the_other_commands_take(clip, lmmap):
    path, camera = clip
    code, out, err = lmmap("calibrate", path, "--focal", "--json")
    found = json.loads(out)
    assert code == 0 and "60 degrees" not in err and found["agree"] >= 12
    low, high = found["focal_95_px"]
    assert 0.9 * camera.fx_px < low < high < 1.1 * camera.fx_px
    assert abs(found["focal_px"] - camera.fx_px) < 2 * (high - low)
    written = Camera.load(path.with_suffix(".camera.json"))
    assert written.fx_px == found["focal_px"] and written.size_px == camera.size_px
    code, _, err = lmmap("calibrate", path, "--focal")
    assert code == 1 and "exists" in err


def test_bad_input_is_one_line(clip, lmmap, tmp_path):
    path, _ = clip
    for argv, words in (
        ((path, path, "--focal"), "one recording"),
        ((path, "--focal", "--modality", "event"), "no --modality"),
        ((path, "--focal", "--board", "8x5"), "leave --board out"),
        ((path, "--focal", "--rate", "0"), "--rate 0"),
        ((path, "--focal", "--rate", "2", "-o", tmp_path / "c.json"), "12 are needed"),
    ):
        code, out, err = lmmap("calibrate", *argv)
        assert code == 1 and not out and words in err.splitlines()[-1]


def test_a_known_lens_is_a_start_that_stays(port, rng):
    """Where nothing is seen, the lens is what it was."""
    camera = Camera(64, 48, 60, 60, 31.5, 23.5)
    dark = [np.zeros((48, 64), np.uint8)] * 14
    fit = fit_lens(port_views.Views(views(rng, 14), dark, Counter()), port, camera)
    assert not fit.kept.any() and np.allclose(fit.lens, 0)
