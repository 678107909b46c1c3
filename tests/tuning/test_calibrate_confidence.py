"""The fit of the confidence, and that its answers are those of the estimator."""

import calibrate_confidence as calibrate
import numpy as np
import pytest
from strategies import PORT, pose

from lmmap.geometry.rotations import rotation_angle_rad
from lmmap.pipeline import agreement
from lmmap.pipeline.run import TimedImage, estimate_image
from lmmap.refinement import verify
from lmmap.settings import OURS
from lmmap.types import Ellipse, Estimate, Pose, Status

T0 = pose((180, 120), 0.6, 0.5, 0.8)


def test_a_fit_finds_the_weights_that_made_the_outcomes():
    rng = np.random.default_rng(0)
    weights = np.array([0.5, -1.0, 2.0])
    x = rng.normal(size=(40_000, 2)) * [1, 3] + [0, 1]
    y = rng.random(len(x)) < verify.logistic(x, weights)
    np.testing.assert_allclose(calibrate.logistic_fit(x, y), weights, atol=0.06)


def test_a_weight_of_two_counts_as_two_poses():
    rng = np.random.default_rng(1)
    x, weight = rng.normal(size=(60, 3)), rng.integers(1, 4, 60)
    y = rng.random(60) < verify.logistic(x, np.array([0.2, 1, -1, 0.5]))
    again = calibrate.logistic_fit(np.repeat(x, weight, 0), np.repeat(y, weight))
    np.testing.assert_allclose(calibrate.logistic_fit(x, y, weight.astype(float)), again, atol=1e-9)


def test_misplaced_poses_are_ten_degrees_off_or_have_another_yaw():
    turned = calibrate.misplaced(T0, PORT)
    away = [rotation_angle_rad(T.rotation @ T0.rotation.T) for T in turned]
    np.testing.assert_allclose(away, [calibrate.MISPLACED_RAD] * 4 + [PORT.yaw_period_rad / 2])
    tilts = [np.arccos(np.clip(T.normal @ T0.normal, -1, 1)) for T in turned]
    np.testing.assert_allclose(tilts, [calibrate.MISPLACED_RAD] * 4 + [0], atol=1e-7)
    assert all(T.position_m is T0.position_m or np.array_equal(T.position_m, T0.position_m) for T in turned)


class Told:
    """An estimator that is told the estimate of each look; an image is its number."""

    settings = OURS

    def __init__(self, looks):
        self.looks = looks

    def together(self, estimates):
        return agreement.together(estimates, PORT, OURS)

    def __call__(self, image, t_us):
        plain, turned = self.looks[image]
        return self.together([plain, turned]) if agreement.in_doubt(plain, OURS) else plain


def random_look(rng):
    status = rng.choice([Status.OK, Status.OK, Status.OK, Status.NO_MARKERS, Status.NO_RING])
    ellipse = None if status == Status.NO_RING else Ellipse([100.0, 100.0], [40.0, 30.0], 0.1)
    if status != Status.OK:
        return Estimate(0, status, ellipse=ellipse)
    T = Pose(T0.rotation, T0.position_m + rng.choice([0, 0.005, 0.1]))
    return agreement.report(Estimate(0, status, T, ellipse=ellipse), rng.uniform(0.5, 1), OURS)


@pytest.mark.parametrize("seed", range(60))
def test_answers_of_looks_are_the_estimator_s(seed):
    rng = np.random.default_rng(seed)
    looks = [tuple(random_look(rng) for _ in range(2)) for _ in range(2)]
    _, expected = estimate_image(Told(looks), TimedImage(0, 0, (1, 1)))
    pairs = [tuple((e, False) for e in look) for look in looks]
    told, _ = calibrate.answer(pairs, OURS)
    assert (told.status, told.confidence) == (expected.status, expected.confidence)
    assert told.ellipse is expected.ellipse
