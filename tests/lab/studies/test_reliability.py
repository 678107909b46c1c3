"""A confidence is a probability if of the poses with 0.8 eight in ten are right."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from test_error_table import answer, recording  # noqa: F401

from lmmap.types import Port, Status
from lmmap_lab.studies.reliability import (
    calibration_error,
    confidences,
    error_by_chance,
    of_sequences,
    pooled,
    reliability,
    share_intervals,
)


def test_two_bins_by_hand():
    table = reliability(np.array([0.5, 0.5, 0.97, 0.97]), np.array([True, False, True, False]))
    assert table.bin.tolist() == [0.4, 0.95] and table.poses.tolist() == [2, 2]
    assert table.right.tolist() == [0.5, 0.5]
    assert calibration_error(table) == pytest.approx((0 + 0.47) / 2)


def test_certainty_belongs_to_the_last_bin_and_no_confidence_to_the_first():
    assert reliability(np.array([0.0, 1.0]), np.array([False, True])).bin.tolist() == [0.0, 0.95]


def test_many_draws_of_a_probability_have_no_error():
    rng = np.random.default_rng(1)
    confidence = rng.uniform(size=200_000)
    table = reliability(confidence, rng.uniform(size=len(confidence)) < confidence)
    assert calibration_error(table) < 0.005


def test_chance_errs_less_with_more_poses_as_the_root_of_their_number():
    few = pd.DataFrame(
        {"bin": [0.4, 0.8], "confidence": [0.5, 0.85], "right": [0.5, 0.85], "poses": [25, 25]}
    )
    mean, most = error_by_chance(few)
    of_many = error_by_chance(few.assign(poses=100 * few.poses))
    assert 0 < mean < most
    assert of_many == pytest.approx((mean / 10, most / 10), rel=0.1)


def test_chance_of_a_single_bin_is_that_of_a_binomial_share():
    single_bin = pd.DataFrame({"bin": [0.4], "confidence": [0.5], "right": [0.5], "poses": [400]})
    mean, most = error_by_chance(single_bin, draws=20_000)
    sigma = 0.5 / np.sqrt(400)
    assert mean == pytest.approx(sigma * np.sqrt(2 / np.pi), rel=0.05)
    assert most == pytest.approx(1.96 * sigma, rel=0.05)


def _errors(t_us, position_error_m, in_view=True):
    return pd.DataFrame({"t_us": t_us, "in_view": in_view, "position_error_m": position_error_m,
                         "normal_error_deg": 0.0, "rotation_error_deg": 0.0})  # fmt: skip


def test_of_sequences_counts_the_poses_of_rings_in_view_whatever_their_order():
    errors = [_errors([1, 2, 3], [0.001, 0.5, np.nan]), _errors([1], [0.001], in_view=False)]
    confidences = [pd.DataFrame({"t_us": [3, 2, 1], "confidence": [0.1, 0.96, 0.99]}),
                   pd.DataFrame({"t_us": [1], "confidence": [0.3]})]  # fmt: skip
    table = of_sequences(errors, confidences)
    assert table.poses.tolist() == [2] and table.right.tolist() == [0.5]
    assert table.sure_wrong_percent.tolist() == [50]
    assert table.calibration_error[0] == pytest.approx(0.975 - 0.5)


def test_pooled_sets_are_the_table_of_all_their_poses():
    rng = np.random.default_rng(2)
    confidence, right = rng.uniform(size=500), rng.uniform(size=500) < 0.7
    parts = pd.concat(
        [reliability(confidence[:100], right[:100]), reliability(confidence[100:], right[100:])]
    )
    pd.testing.assert_frame_equal(pooled(parts), reliability(confidence, right))


def test_an_interval_holds_its_share_and_shrinks_with_the_poses():
    table = pd.DataFrame({"right": [0.0, 0.5, 1.0], "poses": [4, 4, 4]})
    few, many = share_intervals(table), share_intervals(table.assign(poses=400))
    assert np.all((few[:, 0] <= table.right) & (table.right <= few[:, 1]))
    assert np.all(many[:, 1] - many[:, 0] < (few[:, 1] - few[:, 0]) / 4)


def test_doubtful_poses_are_right_or_wrong_as_reported_ones_are(recording):  # noqa: F811
    reported = [replace(answer(recording, t_us, shift_m), confidence=0.9)
                for t_us, shift_m in ((100_000, 0.0), (200_000, 0.1))]  # fmt: skip
    doubtful = [replace(e, status=Status.UNSURE, T_cam_port=None, doubtful=e.T_cam_port) for e in reported]
    without = answer(recording, 300_000, status=Status.NO_RING)
    for estimates in (reported, doubtful):
        table = confidences(recording, [*estimates, without], Port.lm_map())
        assert table.right.tolist()[:2] == [1, 0] and np.isnan(table.right[2])
        assert table.confidence.tolist() == [0.9, 0.9, 0]
