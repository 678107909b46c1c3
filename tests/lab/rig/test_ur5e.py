"""The arm: forward kinematics against the textbook's, and its inverse against itself."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from lmmap.types import Pose
from lmmap_lab.rig import ur5e

ANGLES = st.lists(st.floats(-3, 3), min_size=6, max_size=6).map(np.array)


def denavit_hartenberg(joints_rad):
    """Rz(q) Tz(d) Tx(a) Rx(alpha), multiplied out joint by joint; lengths of the UR5e's data sheet."""
    T = np.diag([-1.0, -1.0, 1.0, 1.0])  # base_link is turned by pi against the controller's base
    rows = [(0.1625, 0, np.pi / 2), (0, -0.425, 0), (0, -0.3922, 0), (0.1333, 0, np.pi / 2),
            (0.0997, 0, -np.pi / 2), (0.0996, 0, 0)]  # fmt: skip
    for q, (d, a, alpha) in zip(joints_rad, rows, strict=True):
        c, s, ca, sa = np.cos(q), np.sin(q), np.cos(alpha), np.sin(alpha)
        T = T @ np.array([[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d],
                          [0, 0, 0, 1]])  # fmt: skip
    return T


@given(ANGLES)
def test_forward_is_denavit_hartenbergs(joints_rad):
    T, wanted = ur5e.forward(joints_rad), denavit_hartenberg(joints_rad)
    np.testing.assert_allclose(T.rotation, wanted[:3, :3], atol=1e-12)
    np.testing.assert_allclose(T.position_m, wanted[:3, 3], atol=1e-12)


@given(ANGLES)
def test_every_branch_of_the_inverse_reaches_the_pose(joints_rad):
    assume(
        np.abs(np.sin(joints_rad[[2, 4]])).min() > 1e-2
    )  # stretched, or joints 4 and 6 turn about one axis
    T = ur5e.forward(joints_rad[None])
    branches = ur5e.inverse(T)[0]
    reached = branches[~np.isnan(branches).any(1)]
    turns = (reached - joints_rad + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(turns).max(1).min() < 1e-5  # the joints that made the pose are among them
    again = ur5e.forward(reached)
    np.testing.assert_allclose(again.position_m, np.broadcast_to(T.position_m, (len(reached), 3)), atol=1e-7)
    np.testing.assert_allclose(again.rotation, np.broadcast_to(T.rotation, (len(reached), 3, 3)), atol=1e-6)


def test_a_path_is_followed_without_jumps():
    t = np.linspace(0, 4, 200)[:, None]
    wanted = np.array([0.3, -1.5, 1.2, -0.4, 1.4, 3.0]) + 0.4 * np.sin(t * np.arange(1, 7) / 2)
    T = ur5e.forward(wanted)
    joints = ur5e.follow(T)
    assert np.abs(np.diff(joints, axis=0)).max() < 0.2
    np.testing.assert_allclose(ur5e.forward(joints).position_m, T.position_m, atol=1e-9)


def test_a_path_out_of_reach_is_an_error():
    with pytest.raises(ValueError, match="reach"):
        ur5e.follow(Pose(np.eye(3)[None], [[2.0, 0, 0]]))
