"""Labels are poses that the images before and after confirm, as different as the recording has them."""

import moving
import numpy as np
import pytest
from strategies import CAMERA, PORT, moved

from lmmap.evaluation.pose_errors import position_error_m
from lmmap.pipeline.agreement import alike
from lmmap.pipeline.estimator import Estimator
from lmmap.settings import OURS
from lmmap_lab.adaptation import self_labels
from lmmap_lab.adaptation.self_labels import Look
from lmmap_lab.adaptation.smooth_track import SmoothTrack
from lmmap_lab.bench.labels import label_masks

ESTIMATOR = Estimator(CAMERA, weights=(len, len))
COUNT = 60


def labels(estimates) -> list:
    track = SmoothTrack(moving.told(estimates), PORT.yaw_period_rad)
    return [self_labels.label_pose(e, track, ESTIMATOR) for e in estimates]


def right(T, k) -> bool:
    return alike(T, moving.true_pose(k), PORT, OURS)


def test_a_pose_that_its_neighbours_contradict_is_no_label():
    seen = [moving.estimate(k, moving.true_pose(k)) for k in range(12)]
    seen[5] = moving.estimate(5, moved(moving.true_pose(5), [0, 0, 0.03, 0, 0, 0]), 0.999)
    taught = {k: T for k, T in enumerate(labels(seen)) if T is not None}
    assert 5 not in taught and len(taught) >= 9  # its neighbours may be in doubt as well
    assert all(right(T, k) for k, T in taught.items())


def test_a_hard_image_is_labelled_by_the_track_and_an_unsure_pose_is_none():
    seen = [moving.estimate(k, None if k in (5, 6) else moving.true_pose(k)) for k in range(12)]
    seen[8] = moving.estimate(8, moved(moving.true_pose(8), [0, 0, 0.03, 0, 0, 0]), 0.6)
    for k, T in enumerate(labels(seen)):
        assert position_error_m(T, moving.true_pose(k)) < 2e-3


def test_far_from_any_pose_there_is_no_label():
    seen = [moving.estimate(k, moving.true_pose(k) if k < 4 or k > 30 else None) for k in range(35)]
    assert labels(seen)[17] is None


@pytest.mark.parametrize("seed", range(4))
def test_when_three_of_ten_sure_poses_are_wrong_hardly_a_label_is(seed):
    rng = np.random.default_rng(seed)
    bad = set(rng.choice(COUNT, 3 * COUNT // 10, replace=False).tolist())
    poses = [
        moving.wrong(moving.true_pose(k), rng) if k in bad else moving.true_pose(k) for k in range(COUNT)
    ]
    chosen = [(k, T) for k, T in enumerate(labels([moving.estimate(k, T) for k, T in enumerate(poses)])) if T]
    assert len(chosen) > COUNT / 4
    assert all(right(T, k) for k, T in chosen)


def test_chosen_images_are_spread_over_time_and_views():
    seen = [moving.estimate(k, moving.true_pose(0 if k < 40 else k)) for k in range(COUNT)]
    looks = [Look(e.t_us, np.zeros((2, 2)), e) for e in seen]
    chosen = self_labels.choose(looks, [e.T_cam_port for e in seen], 12)
    assert len(chosen) == 12 and chosen == sorted(set(chosen))
    assert sum(k >= 40 for k in chosen) >= 5  # a third of the time, but most of the views
    assert min(chosen) < 10 and max(chosen) == COUNT - 1
    assert self_labels.choose(looks, [None] * COUNT) == []


def test_masks_are_the_benchs_and_empty_where_the_port_is_out_of_view():
    T, away = moving.true_pose(0), moved(moving.true_pose(0), [2.0, 0, 0, 0, 0, 0])
    images = [np.zeros((260, 346, 3), np.uint8)] * 2
    ring, markers = self_labels.labelled(images, [T, away], ESTIMATOR)
    assert len(ring) == 2
    for k, samples in enumerate((ring, markers)):
        assert np.array_equal(samples.mask(0), label_masks(T, PORT, CAMERA)[k]) and samples.mask(0).any()
        assert not samples.mask(1).any()
