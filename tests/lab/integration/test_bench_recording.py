"""The whole path on the committed recording of the bench, with the shipped weights."""

import numpy as np
import pytest

from lmmap.estimation.estimates import estimate
from lmmap.estimation.images import images
from lmmap.evaluation.pose_errors import normal_error_rad, position_error_m, true_poses
from lmmap.geometry.port import in_view
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.weights import load_network, weight_path
from lmmap.recordings.formats import open_recording
from lmmap.settings import PAPER
from lmmap.shipped import DATA
from lmmap.types import Status


@pytest.fixture(scope="module")
def recording():
    return open_recording(DATA / "mini" / "test-low.aedat4")


@pytest.fixture(scope="module", params=["rgb", "event"])
def answers(request, recording):
    estimator = Estimator(modality=request.param)
    return estimator, list(estimate(recording, estimator))


def test_every_image_is_answered(recording, answers):
    estimator, estimates = answers
    expected = {"rgb": len(recording.frames), "event": len(recording.events) // PAPER.events_per_window}
    assert len(estimates) == expected[estimator.modality] > 10
    for e in estimates:
        assert (e.T_cam_port is not None) == (e.status == Status.OK) == (e.rival is not None)
    assert np.all(np.diff([e.t_us for e in estimates]) > 0)


def test_poses_are_near_the_truth_and_the_printed_formula_is_further(recording, answers):
    _, estimates = answers
    known, truth = true_poses(recording, estimates)
    ok = np.array([e.status == Status.OK for e in known])
    seen = in_view(truth, answers[0].port, recording.camera)
    assert ok[seen].mean() > 0.7
    ours = [(e.T_cam_port, e.printed, t) for e, t in zip(known, truth, strict=True) if e.status == Status.OK]
    position = np.median([position_error_m(a, t) for a, _, t in ours])
    normal, printed = (np.median([normal_error_rad(p[i], p[2]) for p in ours]) for i in (0, 1))
    assert position < 0.015
    assert np.rad2deg(normal) < 2.0
    assert normal < printed


@pytest.mark.parametrize("modality", ["rgb", "event"])
def test_bfloat16_finds_the_same_mask(recording, modality):
    _, image = list(images(recording, modality))[10]
    path = weight_path("ring", modality)
    plain, fast = (load_network(path, modality, p)(image) for p in ("float32", "bfloat16"))
    assert ((plain > 0.5) & (fast > 0.5)).sum() >= 0.98 * ((plain > 0.5) | (fast > 0.5)).sum() > 0
