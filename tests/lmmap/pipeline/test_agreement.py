"""What several looks at one image say together."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from strategies import CAMERA, PORT, pose

from lmmap.pipeline import agreement
from lmmap.pipeline.setup import Setup
from lmmap.settings import OURS, PerCamera
from lmmap.types import Estimate, Pose, Status

T0 = pose((180, 120), 0.6, 0.5, 0.8)


def look(confidence, T=T0, t_us=0):
    return Estimate(t_us, Status.OK, T).judged(confidence, 0.85)


def moved(position_m=(0, 0, 0), turn_rad=(0, 0, 0)):
    return Pose(Rotation.from_rotvec(turn_rad).as_matrix() @ T0.rotation, T0.position_m + position_m)


def together(*looks, **changes):
    return agreement.joined(looks, Setup(PORT, CAMERA, "event", replace(OURS, **changes)))


def test_poses_that_agree_are_wrong_only_if_both_are():
    """Independent looks: 0.8 and 0.7 leave 0.2 times 0.3."""
    assert together(look(0.8), look(0.7), look_independence=1.0).confidence == pytest.approx(0.94)
    assert together(look(0.8), look(0.7), look_independence=0.0).confidence == pytest.approx(0.8)


def test_of_poses_that_do_not_agree_at_most_one_is_right():
    """By Bayes: of the four cases, both right is impossible."""
    p, q = 0.8, 0.7
    e = together(look(p), look(q, moved([0.05, 0, 0])))
    possible = p * (1 - q) + (1 - p) * q + (1 - p) * (1 - q)
    assert e.confidence == pytest.approx(p * (1 - q) / possible)
    assert e.status == Status.UNSURE and e.T_cam_port is None and e.doubtful is T0


@pytest.mark.parametrize("independence", [0.0, 0.3, 1.0])
def test_agreement_never_lowers_and_contradiction_never_raises_a_confidence(independence):
    for p in np.linspace(0, 1, 11):
        for q in np.linspace(0, p, 6):
            assert agreement.joined_confidence(p, q, True, independence) >= p - 1e-12
            assert agreement.joined_confidence(p, q, False, independence) <= p + 1e-12


def test_two_doubtful_looks_that_agree_give_a_pose():
    e = together(look(0.7), look(0.75, t_us=5), look_independence=1.0, min_confidence=PerCamera(0.0, 0.9))
    assert (e.status, e.t_us, e.T_cam_port, e.doubtful) == (Status.OK, 5, T0, None)


def test_the_answer_is_the_most_confident_look_whatever_their_order():
    looks = [look(0.6), look(0.9, t_us=7), look(0.8)]
    answers = [together(*np.roll(looks, k)) for k in range(3)]
    assert {e.t_us for e in answers} == {7}
    np.testing.assert_allclose([e.confidence for e in answers], answers[0].confidence)


def test_without_a_pose_the_first_look_answers_and_one_pose_stays_as_it_is():
    nothing, other = Estimate(1, Status.NO_MARKERS), Estimate(2, Status.NO_RING)
    assert together(nothing, other) is nothing
    assert together(nothing, sure := look(0.97)) is sure
    assert together(nothing, doubtful := look(0.3)) is doubtful


@pytest.mark.parametrize("share, agree", [(0.9, True), (1.1, False)])
def test_alike_is_within_the_errors_one_may_dock_on(share, agree):
    tilt_rad, turn_rad = share * OURS.right_normal_rad, share * OURS.right_rotation_rad
    steps = [moved([share * OURS.right_position_m, 0, 0]), moved(turn_rad=tilt_rad * T0.rotation[:, 0]),
             moved(turn_rad=turn_rad * T0.normal)]  # fmt: skip
    assert [agreement.alike(T0, T, PORT, OURS) for T in steps] == [agree] * 3
    period = moved(turn_rad=PORT.yaw_period_rad * T0.normal)
    assert agreement.alike(T0, period, PORT, OURS)


@pytest.mark.parametrize(
    "estimate, doubt",
    [(look(0.999), False), (look(0.94), True), (look(0.2), True), (Estimate(0, Status.NO_MARKERS), True),
     (Estimate(0, Status.NO_RING), False), (Estimate(0, Status.NO_ELLIPSE), False)],
)  # fmt: skip
def test_a_ring_without_a_sure_pose_is_in_doubt(estimate, doubt):
    assert agreement.in_doubt(estimate, OURS) == doubt
