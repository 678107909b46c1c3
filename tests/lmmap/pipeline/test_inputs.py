"""Every wrong image gets an answer that names the argument, what was expected, and what came."""

from concurrent.futures import ThreadPoolExecutor

import drawn
import numpy as np
import pytest
from strategies import pose

import lmmap
from lmmap.pipeline.inputs import as_camera, check_image
from lmmap.types import Camera, InputError

CAMERA = Camera.davis346()
FRAME = np.zeros((260, 346, 3), np.uint8)


@pytest.mark.parametrize(
    "image, answer",
    [
        (None, "numpy array .* got NoneType"),
        (FRAME.tolist(), "numpy array .* got list"),
        (FRAME / 255.0, r"uint8 RGB, got \(260, 346, 3\) float64; scale 0 to 1 by"),
        (FRAME.astype(np.uint16), "uint16; give uint8"),
        (FRAME[..., 0], r"got \(260, 346\) uint8; repeat the grey values"),
        (FRAME[..., :1], "give three channels"),
        (np.dstack([FRAME, FRAME[..., 0]]), r"got \(260, 346, 4\) uint8; leave the fourth channel out"),
        (FRAME[None], r"got \(1, 260, 346, 3\)"),
        (FRAME[:-1], r"the camera's calibration is for images of \(260, 346\)"),
        (FRAME[:, :, None], "got"),
    ],
)
def test_frames_that_are_none(image, answer):
    with pytest.raises(ValueError, match=rf"^image: expected .*{answer}"):
        check_image(image, "rgb", CAMERA)


@pytest.mark.parametrize(
    "image, answer",
    [
        (FRAME, "frames are for modality='rgb'"),
        (FRAME[..., 0].astype(bool), "counts are numbers from 0"),
        (FRAME[..., 0] - 1.0, "counts are numbers from 0"),
        (np.full((260, 346), np.nan), "counts are numbers from 0"),
        (FRAME[:9, :9, 0], r"calibration is for images of \(260, 346\)"),
    ],
)
def test_histograms_that_are_none(image, answer):
    with pytest.raises(ValueError, match=rf"^image: expected .* event counts, got .*{answer}"):
        check_image(image, "event", CAMERA)


def test_what_the_modalities_have_is_taken():
    check_image(FRAME, "rgb", CAMERA)
    for kind in (np.uint8, np.uint16, np.int64, np.float32):
        check_image(FRAME[..., 0].astype(kind), "event", CAMERA)


def test_a_camera_may_be_its_calibration_file(tmp_path):
    CAMERA.save(tmp_path / "cal.json")
    assert (
        as_camera(tmp_path / "cal.json") == as_camera(str(tmp_path / "cal.json")) == as_camera(None) == CAMERA
    )
    assert lmmap.Estimator(str(tmp_path / "cal.json")).camera == CAMERA
    with pytest.raises(InputError, match=r"absent\.yaml"):
        lmmap.Estimator(tmp_path / "absent.yaml")
    with pytest.raises(ValueError, match=r"camera: expected Camera \| str \| Path \| None, got array"):
        lmmap.Estimator(np.eye(3))


def test_unknown_weights_name_those_that_ship():
    with pytest.raises(
        InputError, match=r"lowest: no readable weights \(no such folder\); .* high, low, robust"
    ):
        lmmap.Estimator(weights="lowest")


def test_the_estimator_checks_its_images():
    with pytest.raises(ValueError, match=r"^image: expected .* got \(260, 346, 3\) float64"):
        lmmap.Estimator()(FRAME / 255.0)


@pytest.mark.parametrize("t_us", [2**63, 1e300, float("nan"), None, "0", [0]])
def test_times_that_are_none(t_us):
    """Of every estimator, and of a tracker."""
    for estimator in (lmmap.Estimator(), lmmap.PrintedEstimator(), lmmap.Tracker(lmmap.Estimator())):
        with pytest.raises(ValueError, match=r"t_us: expected .*, got "):
            estimator(FRAME, t_us)


def test_eight_threads_on_one_estimator_answer_as_one():
    small, rng = Camera(160, 120, 324.0, 324.0, 79.5, 59.5), np.random.default_rng(0)
    poses = [pose((78, 60), range_m, 0.4, 0.5, camera=small) for range_m in (0.8, 0.9)]
    estimator, frames = lmmap.Estimator(small), [drawn.frame(T, rng, small) for T in poses]
    alone = [estimator(frame) for frame in frames]
    with ThreadPoolExecutor(8) as pool:
        together = list(pool.map(estimator, [frames[k % 2] for k in range(16)]))
    assert all(e.T_cam_port is not None for e in alone)
    for k, e in enumerate(together):
        assert repr(e) == repr(alone[k % 2])
