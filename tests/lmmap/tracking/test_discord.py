"""Laws of two cameras' poses: who sees the same port agrees, and who sees another never does."""

import numpy as np
import pytest
from strategies import moved
from test_fusion import PERIOD, T0, seen

from lmmap.geometry.rotations import equal_turns
from lmmap.tracking.discord import Discord
from lmmap.types import Estimate, Pose, Status

TURN, APART = np.array([0, 0, 0, 0, 0, 1.0]), np.array([0.2, 0, 0, 0, 0, 0])


def both(offsets, step_us=25_000):
    """Poses by turns, the event camera's moved by an offset each."""
    discord = Discord(PERIOD)
    for k, offset in enumerate(offsets):
        discord.add("rgb", seen(2 * k * step_us, T0))
        discord.add("event", seen((2 * k + 1) * step_us, moved(T0, np.asarray(offset, float))))
    return discord


def test_cameras_that_see_the_same_agree():
    discord = both([np.zeros(6)] * 5)
    assert (discord.agreed, discord.contradicted) == (9, 0) and not discord.is_throughout
    assert discord.judged(seen(0, T0)).status == Status.OK
    discord.tell("r")


@pytest.mark.parametrize("k", [1, 2])
def test_yaws_that_cannot_be_told_apart_agree(k):
    discord = Discord(PERIOD)
    discord.add("rgb", seen(0))
    discord.add("event", seen(9000, Pose(T0.rotation @ equal_turns(PERIOD)[k], T0.position_m)))
    assert (discord.agreed, discord.contradicted) == (1, 0)


@pytest.mark.parametrize("offset", [APART, 0.8 * TURN, -APART])
def test_cameras_that_see_another_port_are_told(offset):
    discord = both([offset] * 3)
    assert (discord.agreed, discord.contradicted) == (0, 5)
    judged = discord.judged(seen(0, T0))
    assert judged.status == Status.UNSURE and judged.T_cam_port is None and judged.found == T0
    with pytest.warns(UserWarning, match=r"^r: the two cameras' poses contradict each other in 5 of 5 pairs"):
        discord.tell("r")


def test_one_wrong_pose_of_many_says_nothing():
    discord = both([np.zeros(6), APART, np.zeros(6), np.zeros(6)])
    assert (discord.agreed, discord.contradicted) == (5, 2) and not discord.is_throughout


def test_poses_far_apart_in_time_or_of_one_camera_are_not_compared():
    assert both([APART] * 4, step_us=300_000).contradicted == 0
    discord = Discord(PERIOD)
    for k in range(4):
        discord.add("rgb", seen(25_000 * k, moved(T0, k * APART)))
        discord.add("event", Estimate(25_000 * k, Status.NO_RING))
    assert discord.contradicted == discord.agreed == 0
