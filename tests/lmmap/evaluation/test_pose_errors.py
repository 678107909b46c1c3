"""Errors of poses: independent of the camera's frame, and worked by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import PORT, rigid_poses, rotations

from lmmap.evaluation.pose_errors import normal_error_rad, position_error_m, rotation_error_rad
from lmmap.geometry.rotations import rotation_z
from lmmap.types import Pose

PERIOD = PORT.yaw_period_rad


@given(rigid_poses(), rotations(), st.tuples(*[st.floats(-1, 1)] * 3))
def test_errors_do_not_depend_on_the_camera_frame(T, R, shift):
    other = Pose(T.rotation @ rotation_z(0.3), T.position_m + shift)
    world = Pose(R, [1, 2, 3])
    for error in (position_error_m, normal_error_rad):
        np.testing.assert_allclose(error(world @ T, world @ other), error(T, other), atol=1e-7)
    before = rotation_error_rad(T, other, PERIOD)
    np.testing.assert_allclose(rotation_error_rad(world @ T, world @ other, PERIOD), before, atol=1e-7)


@given(rigid_poses(), rotations())
def test_the_rotation_error_is_no_smaller_than_the_normals(T, R):
    other = Pose(R, T.position_m)
    normal, rotation = (normal_error_rad(T, other), rotation_error_rad(T, other, PERIOD))
    assert rotation >= normal - 1e-7


def test_errors_of_a_known_pose():
    truth = Pose(np.eye(3), [0, 0, 1])
    tilt = np.array([[1, 0, 0], [0, 0.8, -0.6], [0, 0.6, 0.8]])
    estimate = Pose(tilt, [0.3, 0, 1.4])
    assert position_error_m(estimate, truth) == pytest.approx(0.5)
    assert normal_error_rad(estimate, truth) == pytest.approx(np.arcsin(0.6))
    assert rotation_error_rad(estimate, truth, PERIOD) == pytest.approx(np.arcsin(0.6))
    yawed = Pose(rotation_z(np.deg2rad(110)), [0, 0, 1])
    assert normal_error_rad(yawed, truth) == pytest.approx(0)
    assert np.rad2deg(rotation_error_rad(yawed, truth, PERIOD)) == pytest.approx(10)
    assert np.rad2deg(rotation_error_rad(yawed, truth, 2 * np.pi)) == pytest.approx(110)
