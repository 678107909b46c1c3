"""New networks are asked only if they explain what the old ones do and find more, and add no wrong poses."""

from dataclasses import replace

import moving
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import CAMERA, moved

from lmmap.pipeline.estimator import Estimator
from lmmap_lab.adaptation.guard import Guard
from lmmap_lab.adaptation.self_labels import SURE
from lmmap_lab.adaptation.smooth_track import SmoothTrack

ESTIMATOR = Estimator(CAMERA, weights=(len, len))
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


def judged(guard: Guard, new, **options):
    """By a guard that is shown the new estimates which it asks for."""
    return guard.judge([e for e, ask in zip(new, guard.asked, strict=True) if ask], **options)


EVERY_OTHER = guard_of(estimates(set(range(0, COUNT, 2))))


def test_networks_that_find_more_are_taken_and_must_be_as_sure_as_a_label():
    verdict = judged(EVERY_OTHER, estimates(set(KEPT)))
    assert (verdict.taken, verdict.min_confidence, verdict.more) == (True, SURE, 5)
    assert (verdict.before, verdict.after, verdict.images) == ((5, 0), (10, 0), 10)
    assert "believes 5 poses" in str(verdict) and "alone 10 and 0; 5 images" in str(verdict)
    assert not judged(EVERY_OTHER, estimates(set(KEPT), confidence=SURE - 0.01)).taken


def test_networks_that_find_no_more_or_explain_less_where_they_were_not_taught_are_not():
    taught = set(range(COUNT)) - set(KEPT)
    for found in (set(), set(KEPT[::2]), set(range(0, COUNT, 2)), taught | set(KEPT[:4])):
        assert not judged(EVERY_OTHER, estimates(found)).taken
    assert judged(EVERY_OTHER, estimates(taught | set(KEPT[:5]))).taken


def test_where_nothing_is_lacking_those_for_later_images_have_to_explain_no_less():
    guard = guard_of(estimates(set(range(COUNT))))
    for found, taken in ((set(KEPT), True), (set(KEPT[1:]), False)):
        new = estimates(found)
        assert judged(guard, new, for_later=True).taken == taken and not judged(guard, new).taken


@pytest.mark.parametrize("wrong, raised", [({13, 21, 31}, True), ({13}, False), ({12, 14, 16, 30}, False)])
def test_the_limit_rises_where_the_track_contradicts_more_of_what_is_added_than_a_label_may_be(wrong, raised):
    new = estimates(set(range(COUNT)), wrong, confidence=0.99)
    new = [replace(e, confidence=0.95) if k in wrong else e for k, e in enumerate(new)]
    verdict = judged(EVERY_OTHER, new)
    assert verdict.taken and verdict.after == (10 - len(wrong & set(KEPT)), len(wrong & set(KEPT)))
    assert 0.95 < verdict.min_confidence < 0.951 if raised else verdict.min_confidence == SURE
    new = [replace(e, confidence=0.995) if k in wrong else e for k, e in enumerate(new)]
    assert judged(EVERY_OTHER, new).taken != raised  # surer than every right one


@pytest.mark.parametrize("wrong, allowed", [(1, True), (2, False)])
def test_one_of_ten_may_be_contradicted(wrong, allowed):
    added = list(range(1, 20, 2))
    verdict = judged(EVERY_OTHER, estimates(set(range(0, COUNT, 2)) | set(added), set(added[:wrong])))
    assert (verdict.min_confidence == SURE) == allowed == verdict.taken


@given(
    st.lists(st.tuples(st.booleans(), st.booleans(), st.floats(0.01, 1.0)), min_size=COUNT, max_size=COUNT)
)
def test_of_what_new_networks_add_no_more_is_wrong_where_the_track_knows_than_a_label_may_be(images):
    found, wrong = ({k for k, image in enumerate(images) if image[part]} for part in (0, 1))
    new = [replace(e, confidence=p) for e, (_, _, p) in zip(estimates(found, wrong), images, strict=True)]
    verdict = judged(EVERY_OTHER, new)
    assert verdict.min_confidence >= SURE
    known = {k for k in found if k % 2 and new[k].confidence >= verdict.min_confidence} - {COUNT - 1}
    assert len(known & wrong) <= 0.1 * len(known)
    assert verdict.taken == (verdict.after[0] >= 5 and verdict.more > 0)
    assert verdict.more <= len(known - wrong) + 1


def test_new_networks_look_only_where_they_may_add_or_are_guarded():
    assert list(np.flatnonzero(~EVERY_OTHER.asked)) == [k for k in range(0, COUNT, 2) if k not in KEPT]


@pytest.mark.parametrize("away", [0.0, 2.0])
def test_an_image_lacks_a_pose_only_where_the_port_is_in_view(away):
    aside = np.array([away, 0, 0, 0, 0, 0])
    seen = [moving.estimate(k, moved(moving.true_pose(k), aside) if k % 2 else None) for k in range(COUNT)]
    assert guard_of(seen).lacking() == (0 if away else 0.5)
    assert guard_of(estimates(set(range(COUNT)))).lacking() == 0


def test_a_pose_that_one_look_is_not_enough_for_is_lacking():
    assert guard_of(estimates(set(range(COUNT)), confidence=0.9)).lacking() == 1
