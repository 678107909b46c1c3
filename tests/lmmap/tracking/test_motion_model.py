"""Laws of the motion state: time adds up, a measurement's weight, and what may not happen."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from strategies import pose

from lmmap.tracking.motion_model import MotionState
from lmmap.types import Pose

T0 = pose((200, 110), 0.6, 0.4, 0.7, 0.3)
LOOSE = np.diag([2e-3, 2e-3, 4e-3, 0.02, 0.02, 0.01]) ** 2


def moved(T, step) -> Pose:
    return Pose(Rotation.from_rotvec(step[3:]).as_matrix() @ T.rotation, T.position_m + step[:3])


def test_two_steps_in_time_are_as_one():
    start = MotionState.start(0, T0, LOOSE)
    once, twice = start.predict(80_000), start.predict(30_000).predict(80_000)
    np.testing.assert_allclose(twice.T_cam_port.position_m, once.T_cam_port.position_m, atol=1e-12)
    np.testing.assert_allclose(twice.covariance, once.covariance, atol=1e-12)


def test_a_pose_as_sure_as_the_state_moves_it_half_way():
    start, step = MotionState.start(0, T0, LOOSE), np.array([2e-3, -1e-3, 3e-3, 0.0, 0.02, 0.0])
    state = start.update(moved(T0, step), LOOSE)
    np.testing.assert_allclose(state.T_cam_port.position_m - T0.position_m, step[:3] / 2, atol=1e-12)
    turned = Rotation.from_matrix(state.T_cam_port.rotation @ T0.rotation.T).as_rotvec()
    np.testing.assert_allclose(turned, step[3:] / 2, atol=1e-9)
    np.testing.assert_allclose(state.pose_covariance, LOOSE / 2, atol=1e-12)


def test_an_earlier_time_is_refused_with_both_times():
    with pytest.raises(ValueError, match="t_us: expected 1000 or later, got 999"):
        MotionState.start(1000, T0, LOOSE).predict(999)
