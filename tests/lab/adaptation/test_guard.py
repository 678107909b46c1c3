"""New networks are taken only where they find more, and never with more poses that the track contradicts."""

import moving
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import CAMERA, moved

from lmmap.pipeline.estimator import Estimator
from lmmap_lab.adaptation.guard import Guard
from lmmap_lab.adaptation.smooth_track import SmoothTrack

ESTIMATOR = Estimator(CAMERA, weights=(None, None))
LIMIT = max(ESTIMATOR.settings.min_confidence.rgb, ESTIMATOR.settings.min_confidence.event)
COUNT, KEPT = 40, range(10, 20)
IS_KEPT = [k in KEPT for k in range(COUNT)]
TOO_FAR = np.array([0, 0, 0.025, 0, 0, 0])  # as networks err that have learned a place


def estimates(found, wrong=(), confidence=0.97) -> list:
    """Of all images: a pose where it is found, and one that is too far where it is wrong."""
    poses = [moving.true_pose(k) if k in found else None for k in range(COUNT)]
    poses = [moved(moving.true_pose(k), TOO_FAR) if k in wrong else T for k, T in enumerate(poses)]
    return [moving.estimate(k, T, confidence) for k, T in enumerate(poses)]


def guard_of(seen) -> Guard:
    track = SmoothTrack(moving.told(seen), ESTIMATOR.port.yaw_period_rad)
    return Guard(seen, IS_KEPT, track, ESTIMATOR)


EVERY_OTHER = guard_of(estimates(set(range(0, COUNT, 2))))


def test_networks_that_find_more_are_taken_with_the_stricter_cameras_limit():
    verdict = EVERY_OTHER.judge(estimates(set(KEPT)))
    assert (verdict.taken, verdict.min_confidence) == (True, LIMIT)
    assert (verdict.before, verdict.after, verdict.images) == ((5, 0), (10, 0), 10)
    assert "5 had a pose" in str(verdict) and "now 10 and 0" in str(verdict)


def test_networks_that_find_no_more_where_they_were_not_taught_are_not():
    taught = set(range(COUNT)) - set(KEPT)
    for found in (set(), set(KEPT[::2]), taught | set(KEPT[:5])):
        assert not EVERY_OTHER.judge(estimates(found)).taken


@pytest.mark.parametrize("confidence, taken", [(0.96, False), (0.97, False), (0.98, True)])
def test_networks_that_find_as_much_are_taken_if_they_are_surer(confidence, taken):
    verdict = EVERY_OTHER.judge(estimates(set(KEPT[::2]), confidence=confidence))
    assert verdict.taken == taken
    assert np.allclose(verdict.belief, (0.97 / 2, confidence / 2))


@pytest.mark.parametrize("k", [13, 30])
def test_the_limit_rises_above_poses_that_the_track_contradicts(k):
    new = estimates(set(range(COUNT)), confidence=0.99)
    new[k] = moving.estimate(k, moved(moving.true_pose(k), TOO_FAR), 0.95)
    verdict = EVERY_OTHER.judge(new)
    assert verdict.taken and 0.95 < verdict.min_confidence < 0.951
    assert verdict.after == (10 - (k in KEPT), 0)
    new[k] = moving.estimate(k, moved(moving.true_pose(k), TOO_FAR), 0.995)
    assert not EVERY_OTHER.judge(new).taken  # surer than every right one


@given(
    st.lists(st.tuples(st.booleans(), st.booleans(), st.floats(0.01, 1.0)), min_size=COUNT, max_size=COUNT)
)
def test_wrong_poses_never_rise_and_the_limit_never_falls(images):
    new = []
    for k, (found, wrong, confidence) in enumerate(images):
        T = moving.true_pose(k)
        new.append(moving.estimate(k, moved(T, TOO_FAR) if wrong else T, confidence) if found
                   else moving.estimate(k, None))  # fmt: skip
    verdict = EVERY_OTHER.judge(new)
    assert not any(f and w and p >= verdict.min_confidence for f, w, p in images[1:-1])
    assert verdict.after[1] == 0 and verdict.min_confidence >= LIMIT
    assert not verdict.taken or verdict.after[0] >= verdict.before[0]


@pytest.mark.parametrize("away", [0.0, 2.0])
def test_an_image_lacks_a_pose_only_where_the_port_is_in_view(away):
    aside = np.array([away, 0, 0, 0, 0, 0])
    seen = [moving.estimate(k, moved(moving.true_pose(k), aside) if k % 2 else None) for k in range(COUNT)]
    assert guard_of(seen).lacking() == (0 if away else 0.5)
    assert guard_of(estimates(set(range(COUNT)))).lacking() == 0


def test_a_pose_that_one_look_is_not_enough_for_is_lacking():
    assert guard_of(estimates(set(range(COUNT)), confidence=0.9)).lacking() == 1
