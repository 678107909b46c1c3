"""Tables of errors from made-up estimates whose errors are known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from strategies import facing_pose

from lmmap.evaluation import cells, error_table
from lmmap.types import EVENT, Camera, Estimate, Port, Pose, Recording, Status, Trajectory


@pytest.fixture
def recording():
    t_us = np.arange(0, 1_100_000, 100_000)
    pose = facing_pose(0.2, 0.3, 0.1, [0.0, 0.0, 0.6])
    position_m = np.repeat(pose.position_m[None], 11, 0)
    position_m[6:, 0] = 0.5  # out of view
    poses = Pose(np.repeat(pose.rotation[None], 11, 0), position_m)
    blank = np.zeros((0, 260, 346, 3), np.uint8)
    return Recording("x", Camera.davis346(), np.empty(0, EVENT), blank, np.empty(0), Trajectory(t_us, poses))


def answer(recording, t_us, shift_m=0.0, turn_rad=0.0, status=Status.OK):
    truth = recording.truth.at(t_us)
    if status != Status.OK:
        return Estimate(t_us, status)
    R = truth.rotation @ Rotation.from_rotvec([0, 0, turn_rad]).as_matrix()
    off = Pose(R, truth.position_m + np.array([0, 0, shift_m]))
    return Estimate(t_us, status, off, off, truth)


def test_errors_by_hand(recording):
    estimates = [answer(recording, 100_000, 0.010, 2 * np.pi / 3), answer(recording, 200_000, 0.020, 0.1),
                 answer(recording, 300_000, status=Status.NO_RING), answer(recording, 900_000)]  # fmt: skip
    table = error_table.errors(recording, estimates, Port.lm_map())
    assert table.position_error_m.tolist()[:2] == pytest.approx([0.010, 0.020])
    assert table.rotation_error_deg.tolist()[:2] == pytest.approx([0.0, np.rad2deg(0.1)], abs=1e-5)
    assert table.normal_error_deg.tolist()[:2] == pytest.approx([0, 0], abs=1e-5)
    assert table.in_view.tolist() == [True, True, True, False]
    assert np.isnan(table.position_error_m[2])

    report = error_table.report(table)
    assert report["detected_of_all_percent"] == 75
    assert report["detected_of_in_view_percent"] == pytest.approx(200 / 3)
    assert report["paper_formula_position_median_mm"] == pytest.approx(0)


def test_estimates_outside_the_truth_do_not_count(recording):
    table = error_table.errors(
        recording, [Estimate(-5, Status.NO_RING), answer(recording, 500_000)], Port.lm_map()
    )
    assert len(table) == 1


def test_no_pose_at_all_is_a_table_of_nan(recording):
    estimates = [answer(recording, t, status=Status.NO_ELLIPSE) for t in (0, 100_000)]
    table = cells.summary(error_table.errors(recording, estimates, Port.lm_map()))
    rates = table[table.metric == "detection_rate_percent"].value
    assert (rates == 0).all()
    assert table[table.metric == "position_error_m"].value.isna().all()


def test_what_is_uncertain_is_left_out_of_its_variant_only(recording):
    tight, loose = (np.diag([s] * 3 + [10 * s] * 3) ** 2 for s in (1e-3, 1e-1))
    estimates = [
        replace(answer(recording, 100_000 * k, 0.001 * k), covariance=loose if k == 2 else tight)
        for k in range(1, 6)
    ]
    table = error_table.errors(recording, estimates, Port.lm_map())
    assert table.certain.tolist() == [True, False, True, True, True]
    assert table.kept.tolist() == [False, False, True, True, True]
    assert table.certain_kept.tolist() == [False, False, False, False, True]
    assert table.nees.tolist() == pytest.approx([1, 4e-4, 9, 16, 25])
    values = cells.summary(table).set_index(["variant", "outlier_filter", "metric", "statistic"]).value
    assert values["exact", "without", "position_error_m", "median"] == pytest.approx(0.003)
    assert values["certain", "without", "position_error_m", "median"] == pytest.approx(0.0035)
    assert values["certain", "with", "detection_rate_percent", "all"] == pytest.approx(20)
    assert values["printed", "without", "position_error_m", "rmse"] == pytest.approx(0)
