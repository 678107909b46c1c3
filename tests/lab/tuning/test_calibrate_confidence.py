"""The fit of the confidence, and that its answers are those of the estimator."""

from dataclasses import replace

import calibrate_confidence as calibrate
import confidence_sights
import numpy as np
import pytest
from strategies import PORT, pose

from lmmap.geometry.rotations import rotation_angle_rad
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
    turned = confidence_sights.misplaced(T0, PORT)
    away = [rotation_angle_rad(T.rotation @ T0.rotation.T) for T in turned]
    np.testing.assert_allclose(away, [confidence_sights.MISPLACED_RAD] * 4 + [PORT.yaw_period_rad / 2])
    tilts = [np.arccos(np.clip(T.normal @ T0.normal, -1, 1)) for T in turned]
    np.testing.assert_allclose(tilts, [confidence_sights.MISPLACED_RAD] * 4 + [0], atol=1e-7)
    assert all(T.position_m is T0.position_m or np.array_equal(T.position_m, T0.position_m) for T in turned)


def look(confidence: float, x_m: float = 0.0) -> Estimate:
    T = Pose(T0.rotation, T0.position_m + np.array([x_m, 0, 0]))
    ring = Estimate(0, Status.OK, T, ellipse=Ellipse([100.0, 100.0], [40.0, 30.0], 0.1))
    return ring.judged(confidence, 0.85)


@pytest.mark.parametrize("modality", ["rgb", "event"])
def test_an_answer_asks_the_looks_as_the_estimator_does(modality):
    told = calibrate.Told(modality, replace(OURS, look_independence=0.5))
    sure, doubt, elsewhere = look(0.99), look(0.9), look(0.6, 0.1)
    nothing = Estimate(0, Status.NO_RING)
    never = [(look(0.999, 0.3), False)] * 2  # would be the answer if it were asked
    assert calibrate.answer(told, [((sure, True), never[0]), never]) == (sure, True)
    agreed, good = calibrate.answer(told, [((doubt, True), (sure, False)), never])
    assert not good and agreed.ellipse is sure.ellipse and agreed.confidence > sure.confidence
    other, good = calibrate.answer(told, [((elsewhere, False), (sure, True)), never])
    assert good and other.T_cam_port is sure.T_cam_port and other.confidence < sure.confidence
    wide, good = calibrate.answer(told, [((nothing, False), never[0]), ((sure, True), never[0])])
    assert good and wide.T_cam_port is sure.T_cam_port
