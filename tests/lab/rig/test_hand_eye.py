"""Robot-world hand-eye calibration: OpenCV as oracle, recovery from usual errors, what must not matter."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from strategies import PORT

from lmmap.geometry.rotations import rotation_between_rad, rotation_z
from lmmap.types import Pose
from lmmap_lab.bench.laboratory import sequence, sequence_motion
from lmmap_lab.rig import hand_eye, standin
from lmmap_lab.rig.calibration import calibrate_rig, collect_detections
from lmmap_lab.rig.ur5e import ArmMotion

PERIOD = PORT.yaw_period_rad


@given(st.tuples(*[st.floats(-1.7, 1.7)] * 3))
def test_rotation_vectors_are_what_made_the_rotation(vector):
    R = Rotation.from_rotvec(vector).as_matrix()
    np.testing.assert_allclose(hand_eye.rotation_vector(R), vector, atol=1e-6)


def world(X: Pose, Y: Pose, name="realistic-1", seconds=30.0, count=60, delay_s=0.0):
    """Noise-free detections (count,) of a bench trajectory, and the arm along it."""
    t_us = np.arange(0, seconds * 1e6, 8000).astype(np.int64)
    arm = ArmMotion(t_us, X.inverse @ sequence_motion(sequence(name), t_us * 1e-6) @ Y.inverse)
    seen_us = np.linspace(5e5, t_us[-1] - 5e5, count).astype(np.int64)
    T_cam_port = sequence_motion(sequence(name), seen_us * 1e-6 + delay_s)
    return T_cam_port, arm.sample(seen_us)


def assert_same(estimated: Pose, wanted: Pose, atol=1e-5):
    assert rotation_between_rad(estimated.rotation, wanted.rotation, PERIOD) < atol
    np.testing.assert_allclose(estimated.position_m, wanted.position_m, atol=atol)


def random_pose(rng) -> Pose:
    return Pose(Rotation.random(rng=rng).as_matrix(), rng.uniform(-1, 1, 3))


@pytest.mark.parametrize("seed", range(3))
def test_without_noise_it_agrees_with_opencv_and_the_truth(seed):
    X, Y = (random_pose(np.random.default_rng([seed, k])) for k in (0, 1))
    T, arm = world(X, Y)
    A = arm.T_root_tip  # OpenCV's equation: T_cam_world T_world_base = T_cam_gripper T_gripper_base
    R1, t1, R2, t2 = cv2.calibrateRobotWorldHandEye(
        list(T.rotation), list(T.position_m), list(A.rotation), list(A.position_m)
    )
    solution = hand_eye.solve(T, arm, 2 * np.pi)
    assert_same(solution.T_cam_root, Pose(R2, t2.ravel()), 1e-4)
    assert_same(solution.T_tip_port, Pose(R1, t1.ravel()).inverse, 1e-4)
    assert_same(solution.T_cam_root, X)
    assert_same(solution.T_tip_port, Y)
    assert solution.scale == pytest.approx(1, abs=1e-5)
    assert solution.delay_s == pytest.approx(0, abs=1e-4)


@pytest.mark.parametrize("seed", range(2))
def test_flips_of_yaw_do_not_matter(seed):
    T, arm = world(standin.RIG.T_cam_root, standin.RIG.T_tip_port)
    turns = rotation_z(PERIOD * np.random.default_rng(seed).integers(0, 3, len(T)))
    plain, flipped = (
        hand_eye.solve(poses, arm, PERIOD) for poses in (T, Pose(T.rotation @ turns, T.position_m))
    )
    assert_same(plain.T_tip_port, flipped.T_tip_port)
    assert_same(plain.T_cam_root, flipped.T_cam_root)
    least = np.linalg.norm(Rotation.from_matrix(flipped.T_tip_port.rotation).as_rotvec())
    others = flipped.T_tip_port.rotation @ rotation_z(PERIOD * np.arange(3))
    assert least == pytest.approx(np.linalg.norm(Rotation.from_matrix(others).as_rotvec(), axis=-1).min())


def test_scale_and_delay_are_found():
    T, arm = world(standin.RIG.T_cam_root, standin.RIG.T_tip_port, delay_s=0.012)
    solution = hand_eye.solve(Pose(T.rotation, T.position_m / 1.1), arm, PERIOD)
    assert solution.scale == pytest.approx(1.1, rel=1e-4)
    assert solution.delay_s == pytest.approx(0.012, abs=2e-4)
    assert_same(solution.T_tip_port, standin.RIG.T_tip_port, 2e-4)


@pytest.mark.parametrize("camera_known", [False, True])
@pytest.mark.parametrize("name", ["realistic-1", "realistic-4"])
def test_a_minute_of_usual_detections_is_enough(name, camera_known):
    """2 mm, 1 deg, 5 % outliers, any of three yaws, a ring taken for 3 % too small."""
    estimates, arm = standin.simulate_detections(name, 60.0, np.random.default_rng(5), scale=1.03)
    known = standin.RIG.T_cam_root if camera_known else None
    rig = calibrate_rig(
        [collect_detections(estimates, arm)], PORT, (standin.RIG.root, standin.RIG.tip), known
    )
    wanted, facts = standin.RIG.T_tip_port, rig.calibration
    error_m = np.linalg.norm(rig.T_tip_port.position_m - wanted.position_m)
    error_rad = rotation_between_rad(rig.T_tip_port.rotation, wanted.rotation, PERIOD)
    assert error_m < 0.002 and error_rad < np.deg2rad(0.3)
    assert abs(rig.ring_radius_m / (1.03 * PORT.ring_radius_m) - 1) < 0.005
    assert error_m < 4e-3 * facts["port_sigma_mm"] and error_rad < np.deg2rad(4 * facts["port_sigma_deg"])
    assert 90 < facts["kept_percent"] < 97  # the outliers are out
    assert 2.5 < facts["held_out_position_median_mm"] < 4 and 1.2 < facts["held_out_rotation_median_deg"] < 2
    if camera_known:
        assert not facts["file_in_doubt"]


def test_a_wrong_hand_eye_file_is_doubted():
    estimates, arm = standin.simulate_detections("realistic-1", 60.0, np.random.default_rng(6))
    T = standin.RIG.T_cam_root
    wrong = Pose(T.rotation, T.position_m + np.array([0.04, 0, 0]))
    rig = calibrate_rig(
        [collect_detections(estimates, arm)], PORT, (standin.RIG.root, standin.RIG.tip), wrong
    )
    assert rig.calibration["file_in_doubt"]
    assert rig.calibration["file_differs_mm"] == pytest.approx(40, abs=5)


def test_too_few_detections_or_too_little_motion_is_an_error():
    T, arm = world(standin.RIG.T_cam_root, standin.RIG.T_tip_port, count=10)
    with pytest.raises(ValueError, match="10 detections"):
        hand_eye.solve(T, arm, PERIOD)
    T, arm = world(standin.RIG.T_cam_root, standin.RIG.T_tip_port, name="hard-slow")
    with pytest.raises(ValueError, match="too little"):
        hand_eye.solve(T, arm, PERIOD)
