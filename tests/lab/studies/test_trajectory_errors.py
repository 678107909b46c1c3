import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import rigid_poses, rotations, seeds

from lmmap.geometry.rotations import rotation_z
from lmmap.types import Pose, Trajectory
from lmmap_lab.studies.trajectory_errors import associate, relative_errors, umeyama


@given(seeds(), rotations(), st.floats(0.1, 10))
def test_umeyama_finds_the_similarity(seed, R, scale):
    rng = np.random.default_rng(seed)
    points, shift = rng.normal(size=(10, 3)), rng.normal(size=3)
    s, R_found, t = umeyama(points, scale * points @ R.T + shift)
    assert s == pytest.approx(scale)
    np.testing.assert_allclose(R_found, R, atol=1e-9)
    np.testing.assert_allclose(t, shift, atol=1e-8)


@given(seeds())
def test_umeyama_never_mirrors(seed):
    points = np.random.default_rng(seed).normal(size=(10, 3))
    R = umeyama(points, points * [1, 1, -1])[1]
    assert np.linalg.det(R) == pytest.approx(1)


def test_umeyama_refuses_points_on_a_line():
    line = np.outer(np.arange(5.0), [1, 2, 3])
    with pytest.raises(ValueError, match="line"):
        umeyama(line, line)
    with pytest.raises(ValueError, match="expected equal shapes"):
        umeyama(line, line[:3])


def test_times_are_associated_one_to_one():
    i, j = associate([0, 9, 100, 500], [10, 108, 300], 20)
    assert i.tolist() == [1, 2]  # 0 is near 10 too, but 9 is nearer
    assert j.tolist() == [0, 1]
    assert all(a.size == 0 for a in associate([], [1], 20))


def trajectory(positions, rotation=None, t_us=None):
    """From camera positions in the port's frame."""
    positions = np.asarray(positions, float)
    rotation = np.broadcast_to(np.eye(3), (len(positions), 3, 3)) if rotation is None else rotation
    t_us = np.arange(len(positions)) * 100_000 if t_us is None else t_us
    return Trajectory(t_us, Pose(rotation, positions).inverse)


ZIGZAG = np.column_stack([np.arange(20.0), np.arange(20) % 2, np.zeros(20)]) * 0.1


def test_relative_errors_of_a_drift_by_hand():
    # along a straight line in steps of 0.1 m, the estimate adds 0.01 m sideways each step
    straight = np.column_stack([np.arange(11) * 0.1, np.zeros(11), np.zeros(11)])
    drifting = straight + np.column_stack([np.zeros(11), np.arange(11) * 0.01, np.zeros(11)])
    short, long = relative_errors(trajectory(drifting), trajectory(straight), [0.2, 0.5], align_scale=False)
    np.testing.assert_allclose(short.translation_m, np.full(9, 0.02))
    np.testing.assert_allclose(long.translation_m, np.full(6, 0.05))
    np.testing.assert_allclose(long.rotation_rad, 0, atol=1e-9)
    assert long.length_m == 0.5


def test_a_turn_between_two_poses_is_a_rotation_error():
    straight = np.column_stack([np.arange(3) * 0.1, np.zeros(3), np.zeros(3)])
    turning = rotation_z(np.array([0.0, 0.0, 0.1]))
    (error,) = relative_errors(trajectory(straight, turning), trajectory(straight), [0.1], align_scale=False)
    np.testing.assert_allclose(error.rotation_rad, [0, 0.1], atol=1e-9)
    np.testing.assert_allclose(error.translation_m, 0, atol=1e-12)


@given(rigid_poses(), st.floats(0.1, 10))
def test_relative_errors_ignore_a_similarity(world, scale):
    moved = Pose(np.broadcast_to(world.rotation, (20, 3, 3)), scale * (world @ ZIGZAG))
    estimate = Trajectory(np.arange(20) * 100_000, moved.inverse)
    for error in relative_errors(estimate, trajectory(ZIGZAG), [0.3, 1.0]):
        assert len(error.translation_m) > 5
        np.testing.assert_allclose(error.translation_m, 0, atol=1e-9)
        np.testing.assert_allclose(error.rotation_rad, 0, atol=1e-6)


def test_lengths_longer_than_the_path_have_no_errors():
    (error,) = relative_errors(trajectory(ZIGZAG), trajectory(ZIGZAG), [50.0])
    assert error.translation_m.shape == (0,)


def test_stretches_across_a_gap_count_only_near_their_length():
    # a jump of 1 m: no pose is within 20 % of 0.5 m from those before it
    positions = np.array([[0, 0, 0], [0.1, 0.01, 0], [1.1, 0, 0.0]])
    (error,) = relative_errors(trajectory(positions), trajectory(positions), [0.5], align_scale=False)
    assert error.translation_m.shape == (0,)


def test_relative_errors_need_matching_times_and_positive_lengths():
    late = trajectory(ZIGZAG, t_us=np.arange(20) * 100_000 + 50_000)
    with pytest.raises(ValueError, match="at least 2 poses"):
        relative_errors(late, trajectory(ZIGZAG), [0.2])
    with pytest.raises(ValueError, match="lengths_m: expected positive"):
        relative_errors(trajectory(ZIGZAG), trajectory(ZIGZAG), [0.0])
