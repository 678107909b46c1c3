"""Laws of the track between images: what events add, what they leave alone, and the order of times."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from strategies import CAMERA, PORT, edge_events, moved, pose, seeds

from lmmap.settings import OURS
from lmmap.tracking.between import Between
from lmmap.tracking.edges import Edges
from lmmap.tracking.motion_model import MotionState
from lmmap.types import EVENT, Estimate, Pose, Status

EDGES = Edges.of(PORT)
GOOD = np.diag([5e-4, 5e-4, 1e-3, 5e-3, 5e-3, 5e-3]) ** 2
START = pose((150, 120), 0.5, 0.3, 0.7, 0.2)
SPEED = np.array([0.12, 0.05, -0.04, 0.1, -0.2, 0.3])  # m/s and rad/s
STEP_US, LATE_US = 2000, OURS.between.late_us


def at_time(t_us) -> Pose:
    """A port that moves steadily."""
    return moved(START, SPEED * t_us * 1e-6)


def seen(t_us, T=None) -> dict:
    T = T or at_time(t_us - LATE_US)
    return {"event": Estimate(t_us, Status.OK, T, covariance=GOOD, confidence=0.95)}


def started(last_us=200_000) -> Between:
    track = Between(CAMERA, PORT)
    for t_us in range(0, last_us + 1, 50_000):
        track.add(seen(t_us))
    return track


def position_error_m(track, t_us, T) -> float:
    return float(np.linalg.norm(track.at(t_us).T_cam_port.position_m - T.position_m))


def test_a_port_that_speeds_up_is_followed_by_events():
    """Half as fast again after 200 ms: in 80 ms, prediction falls behind by five millimetres."""
    rng, with_events, alone = np.random.default_rng(3), started(), started()
    for t_us in range(202_000, 282_000, STEP_US):
        T = at_time(200_000 + 1.5 * (t_us - LATE_US - 200_000))
        with_events.events(edge_events(rng, t_us, T, 1.5 * SPEED, clutter=300))
    truth = at_time(200_000 + 1.5 * 80_000)
    behind_m = position_error_m(alone, 280_000, truth)
    assert behind_m > 0.004
    assert position_error_m(with_events, 280_000, truth) < 0.3 * behind_m


@settings(max_examples=20)
@given(seeds())
def test_covariance_shrinks_along_normals_only(seed):
    """One piece of an edge: less is unknown along its row h, and as much as before where h sees nothing."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((12, 12))
    state = MotionState(0, START, np.zeros(6), 1e-6 * (A @ A.T + np.eye(12)))  # mm and mrad
    h = EDGES.jacobian(START, CAMERA)[rng.integers(len(EDGES.points_m))]
    after = state.inform(np.outer(h, h), 0 * h)
    P, less = state.pose_covariance, after.pose_covariance
    assert h @ less @ h == pytest.approx(1 / (1 + 1 / (h @ P @ h)))  # information adds up
    free = np.linalg.svd(h[None])[2][1:] @ np.linalg.inv(P)  # directions that do not vary with h
    np.testing.assert_allclose(free @ less @ free.T, free @ P @ free.T, rtol=1e-6, atol=1e-12)


@settings(max_examples=20)
@given(seeds())
def test_information_is_a_measured_pose_where_it_is_regular(seed):
    rng = np.random.default_rng(seed)
    A, B, y = rng.standard_normal((12, 12)), rng.standard_normal((6, 6)), 0.1 * rng.standard_normal(6)
    state, S = MotionState(0, START, np.zeros(6), A @ A.T + np.eye(12)), B @ B.T + 0.1 * np.eye(6)
    corrected, informed = state.correct(y, S), state.inform(np.linalg.inv(S), np.linalg.solve(S, y))
    np.testing.assert_allclose(corrected.covariance, informed.covariance, atol=1e-7)
    np.testing.assert_allclose(corrected.T_cam_port.position_m, informed.T_cam_port.position_m, atol=1e-7)
    np.testing.assert_allclose(corrected.velocity, informed.velocity, atol=1e-7)


def test_a_late_image_counts_at_its_own_time():
    """Told at once or 40 ms late, an image leaves nearly the same track."""
    rng, at_once, late = np.random.default_rng(5), started(), started()
    pieces = {t: edge_events(rng, t, at_time(t - LATE_US), SPEED) for t in range(202_000, 300_000, STEP_US)}
    off = seen(250_500, moved(at_time(250_500 - LATE_US), [1e-3, 0, 1e-3, 0, 0, 0]))
    for t_us, events in pieces.items():
        for track, when in ((at_once, 252_000), (late, 292_000)):
            if t_us == when:
                track.add(off)
            track.events(events)
    a, b = at_once.at(300_000), late.at(300_000)
    sigma_m = np.sqrt(np.diag(a.covariance)[:3])
    assert np.all(np.abs(a.T_cam_port.position_m - b.T_cam_port.position_m) < 0.2 * sigma_m)
    np.testing.assert_allclose(b.covariance, a.covariance, atol=0.05 * np.abs(a.covariance).max())


def test_a_track_is_where_the_port_is_although_its_events_are_late():
    """Frames are not late, and agree with events that are."""
    rng, track = np.random.default_rng(8), Between(CAMERA, PORT)
    for t_us in range(0, 300_000, STEP_US):
        if t_us % 50_000 == 0:
            track.add({"rgb": replace(seen(t_us)["event"], T_cam_port=at_time(t_us))})
        track.events(edge_events(rng, t_us, at_time(t_us - LATE_US), SPEED))
    late_m = np.linalg.norm(SPEED[:3]) * 1e-6 * LATE_US
    assert position_error_m(track, 300_000, at_time(300_000)) < 0.5 * late_m
    off = 1e-6 * OURS.between.late_sigma_us * SPEED  # what all events share
    e = track.at(300_000)
    assert off @ np.linalg.solve(e.covariance, off) < 1


def test_events_without_a_track_or_an_edge_change_nothing():
    rng, track = np.random.default_rng(6), Between(CAMERA, PORT)
    assert track.events(edge_events(rng, 0, START, SPEED)) == 0 and track.state is None
    track = started()
    before = track.at(300_000)
    corner = np.zeros(50, EVENT)
    corner["t_us"] = 210_000 + STEP_US * np.arange(50)
    assert track.events(corner) == 0
    np.testing.assert_array_equal(track.at(300_000).covariance, before.covariance)


def test_pieces_of_the_stream_make_no_difference():
    rng = np.random.default_rng(7)
    whole = np.concatenate(
        [edge_events(rng, t, at_time(t - LATE_US), SPEED) for t in range(202_000, 240_000, STEP_US)]
    )
    at_once, piecewise = started(), started()
    at_once.events(whole)
    for piece in np.split(whole, np.sort(rng.integers(0, len(whole), 20))):
        piecewise.events(piece)
    np.testing.assert_array_equal(
        at_once.at(250_000).T_cam_port.position_m, piecewise.at(250_000).T_cam_port.position_m
    )


def test_times_that_go_back_are_told():
    track = started()
    with pytest.raises(ValueError, match="expected 200000 or later, got 150000"):
        track.add(seen(150_000))
    events = np.zeros(2, EVENT)
    events["t_us"] = 300_000, 299_000
    with pytest.raises(ValueError, match="got 299000 us after 300000 us"):
        track.events(events)
