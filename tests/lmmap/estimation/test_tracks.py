"""Promises of a track over a recording: images are answered as ever, and between them ticks are."""

import numpy as np
import pytest
from strategies import cut
from test_tracker import STEP_US, Scene, of_the_push, pushed

from lmmap.estimation.images import TimedImage
from lmmap.estimation.tracks import track_images
from lmmap.tracking.tracker import Tracker
from lmmap.types import EVENT, Status

SCENE = Scene([pushed(STEP_US * k) for k in range(8)])
EVENTS = of_the_push(252_000, 350_000)


def shots():
    return (TimedImage(STEP_US * k, SCENE.image(k)) for k in range(8))


def both(chunks, rate_hz=200.0):
    """Answers to images and to ticks."""
    answers = list(track_images(shots(), Tracker(SCENE.estimator(), events=True), chunks, rate_hz))
    assert [e.t_us for _, e in answers] == sorted({e.t_us for _, e in answers})
    images = [e for image, e in answers if image is not None]
    return images, [e for image, e in answers if image is None]


def test_with_events_no_image_is_answered_worse():
    """A push contradicts the plain track's motion, and no event that told of it."""
    images, _ = both([EVENTS])
    alone = [e for _, e in track_images(shots(), Tracker(SCENE.estimator()))]
    assert [e.t_us for e in images] == [e.t_us for e in alone] == [STEP_US * k for k in range(8)]
    assert {e.status for e in images} == {Status.OK} < {e.status for e in alone}


def test_ticks_come_at_their_rate_and_say_that_no_image_supports_them():
    _, ticks = both([EVENTS])
    every_us = [t for t in range(0, 7 * STEP_US, 5000) if t % STEP_US]
    assert [e.t_us for e in ticks] == every_us and {e.status for e in ticks} == {Status.PREDICTED}


def test_ticks_know_of_a_push_before_an_image_shows_it():
    (_, with_events), (_, without_events) = both([EVENTS]), both([])
    off_m = [np.linalg.norm(e[-1].T_cam_port.position_m - pushed(e[-1].t_us).position_m)
             for e in (with_events, without_events)]  # fmt: skip
    assert off_m[0] < 0.5 * off_m[1]


@pytest.mark.parametrize("seed", range(3))
def test_chunks_of_the_events_make_no_difference(seed):
    (_, whole), (_, pieces) = both([EVENTS]), both(cut(EVENTS, np.random.default_rng(seed)))
    for a, b in zip(whole, pieces, strict=True):
        np.testing.assert_array_equal(a.T_cam_port.position_m, b.T_cam_port.position_m)


def test_a_gap_costs_no_ticks():
    """An hour without an image: ticks end with the track."""
    late = [*shots(), TimedImage(3_600_000_000, SCENE.image(7))]
    tracker = Tracker(SCENE.estimator(), events=True)
    answers = list(track_images(late, tracker, [np.zeros(0, EVENT)], 200.0))
    lost_us = 7 * STEP_US + 1e6 * tracker.settings.between.motion.lost_s
    assert answers[-1][1].t_us == 3_600_000_000 and answers[-2][1].t_us <= lost_us < 2_000_000
