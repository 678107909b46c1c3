"""A track by the poses before and after: it finds a steady motion, in either direction of time."""

from dataclasses import replace

import moving
import numpy as np
import pytest
from strategies import PORT

from lmmap.evaluation.pose_errors import position_error_m, rotation_error_rad
from lmmap.geometry.rotations import rotation_z
from lmmap.types import Pose
from lmmap_lab.adaptation.smooth_track import SmoothTrack

PERIOD = PORT.yaw_period_rad


def track_of(estimates) -> SmoothTrack:
    return SmoothTrack(moving.told(estimates), PERIOD)


@pytest.mark.parametrize("with_own", [True, False])
def test_it_finds_a_steady_motion_where_images_show_nothing(with_own):
    track = track_of([moving.estimate(k, moving.true_pose(k)) for k in range(20) if k not in (8, 9, 10)])
    for k in (7, 9, 10):
        state = track.at(k * moving.STEP_US, with_own)
        assert position_error_m(state.T_cam_port, moving.true_pose(k)) < 1e-3
        assert rotation_error_rad(state.T_cam_port, moving.true_pose(k), PERIOD) < 2e-3


def test_both_sides_know_more_than_one():
    seen = [moving.estimate(k, moving.true_pose(k)) for k in range(20)]
    at_us = 10 * moving.STEP_US
    alone, both = (track_of(part).at(at_us, False).pose_covariance for part in (seen[:10], seen))
    assert np.all(np.linalg.eigvalsh(alone - both) > 0)


def test_time_backward_is_the_same_motion():
    seen = [moving.estimate(k, moving.true_pose(k)) for k in range(20)]
    last_us = seen[-1].t_us
    mirrored = track_of([replace(e, t_us=last_us - e.t_us) for e in seen])
    for k in (4, 13):
        a, b = track_of(seen).at(k * moving.STEP_US, False), mirrored.at(last_us - k * moving.STEP_US, False)
        assert position_error_m(a.T_cam_port, b.T_cam_port) < 1e-9
        assert np.allclose(a.pose_covariance, b.pose_covariance, rtol=1e-6)


def test_equal_yaws_are_one():
    seen = [moving.estimate(k, moving.true_pose(k)) for k in range(12)]

    def turned(e, k):
        T = e.T_cam_port
        return replace(e, T_cam_port=Pose(T.rotation @ rotation_z(k * PERIOD), T.position_m))

    a, b = (
        track_of(each).at(7 * moving.STEP_US)
        for each in (seen, [turned(e, i % 3) for i, e in enumerate(seen)])
    )
    assert rotation_error_rad(a.T_cam_port, b.T_cam_port, PERIOD) < 1e-9


def test_it_says_nothing_out_of_reach_or_between_two_tracks_that_exclude_each_other(rng):
    assert track_of([]).at(0) is None
    seen = [moving.estimate(k, moving.true_pose(k)) for k in range(4)]
    assert track_of(seen).at(seen[-1].t_us + 1_400_000) is not None
    assert track_of(seen).at(seen[-1].t_us + 1_600_000) is None
    aside = [moving.estimate(k, moving.wrong(moving.true_pose(4), rng)) for k in (5, 6)]
    assert track_of(seen + aside[:1]).at(4 * moving.STEP_US) is None
