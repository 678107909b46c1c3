"""Tables of errors from made-up estimates whose errors are known."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from conftest import facing_pose
from scipy.spatial.transform import Rotation

from lmmap.types import Camera, Estimate, Port, Pose, Recording, Status, Trajectory
from lmmap_lab.provenance import DATA
from lmmap_lab.studies import pose_errors


@pytest.fixture
def recording():
    t_us = np.arange(0, 1_100_000, 100_000)
    pose = facing_pose(0.2, 0.3, 0.1, [0.0, 0.0, 0.6])
    position_m = np.repeat(pose.position_m[None], 11, 0)
    position_m[6:, 0] = 0.5  # out of view
    poses = Pose(np.repeat(pose.rotation[None], 11, 0), position_m)
    blank = np.zeros((0, 260, 346, 3), np.uint8)
    return Recording("x", Camera.davis346(), np.empty(0), blank, np.empty(0), Trajectory(t_us, poses))


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
    table = pose_errors.errors(recording, estimates, Port.lm_map())
    assert table.position_error_m.tolist()[:2] == pytest.approx([0.010, 0.020])
    assert table.rotation_error_deg.tolist()[:2] == pytest.approx([0.0, np.rad2deg(0.1)], abs=1e-5)
    assert table.normal_error_deg.tolist()[:2] == pytest.approx([0, 0], abs=1e-5)
    assert table.in_view.tolist() == [True, True, True, False]
    assert np.isnan(table.position_error_m[2])

    report = pose_errors.report(table)
    assert report["detected_of_all_percent"] == 75
    assert report["detected_of_in_view_percent"] == pytest.approx(200 / 3)
    assert report["paper_formula_position_median_mm"] == pytest.approx(0)


def test_doubtful_poses_are_right_or_wrong_as_reported_ones_are(recording):
    reported = [replace(answer(recording, t_us, shift_m), confidence=0.9)
                for t_us, shift_m in ((100_000, 0.0), (200_000, 0.1))]  # fmt: skip
    doubtful = [replace(e, status=Status.UNSURE, T_cam_port=None, doubtful=e.T_cam_port) for e in reported]
    without = answer(recording, 300_000, status=Status.NO_RING)
    for estimates in (reported, doubtful):
        table = pose_errors.confidences(recording, [*estimates, without], Port.lm_map())
        assert table.right.tolist()[:2] == [1, 0] and np.isnan(table.right[2])
        assert table.confidence.tolist() == [0.9, 0.9, 0]


def test_estimates_outside_the_truth_do_not_count(recording):
    table = pose_errors.errors(
        recording, [Estimate(-5, Status.NO_RING), answer(recording, 500_000)], Port.lm_map()
    )
    assert len(table) == 1


def test_no_pose_at_all_is_a_table_of_nan(recording):
    estimates = [answer(recording, t, status=Status.NO_ELLIPSE) for t in (0, 100_000)]
    table = pose_errors.summary(pose_errors.errors(recording, estimates, Port.lm_map()))
    rates = table[table.metric == "detection_rate_percent"].value
    assert (rates == 0).all()
    assert table[table.metric == "position_error_m"].value.isna().all()


def test_compare_has_every_cell_of_the_papers_table(tmp_path):
    paper = pd.read_csv(DATA / "paper" / "table1.csv").assign(low=0.0, high=1e3)
    twice, frames = paper.assign(variant="printed", value=2 * paper.value), paper[paper.modality == "rgb"]
    variants = [paper.assign(variant="exact"), twice, paper.assign(variant="certain"),
                frames.assign(variant="fused", modality="fused")]  # fmt: skip
    pd.concat(variants).to_csv(tmp_path / "summary.csv", index=False)
    table = pose_errors.compare(tmp_path)
    assert len(table) == len(paper)
    assert table.ours.tolist() == pytest.approx(table.table1.tolist())
    assert table.printed.tolist() == pytest.approx((2 * table.table1).tolist())
    rgb = table[table.modality == "rgb"]
    assert rgb.fused.tolist() == pytest.approx(rgb.table1.tolist())
    assert (table.ours_low == 0).all() and (table.fused_high == 1e3).all()


def test_what_is_uncertain_is_left_out_of_its_variant_only(recording):
    tight, loose = (np.diag([s] * 3 + [10 * s] * 3) ** 2 for s in (1e-3, 1e-1))
    estimates = [
        replace(answer(recording, 100_000 * k, 0.001 * k), covariance=loose if k == 2 else tight)
        for k in range(1, 6)
    ]
    table = pose_errors.errors(recording, estimates, Port.lm_map())
    assert table.certain.tolist() == [True, False, True, True, True]
    assert table.kept.tolist() == [False, False, True, True, True]
    assert table.certain_kept.tolist() == [False, False, False, False, True]
    assert table.nees.tolist() == pytest.approx([1, 4e-4, 9, 16, 25])
    cells = pose_errors.summary(table).set_index(["variant", "outlier_filter", "metric", "statistic"]).value
    assert cells["exact", "without", "position_error_m", "median"] == pytest.approx(0.003)
    assert cells["certain", "without", "position_error_m", "median"] == pytest.approx(0.0035)
    assert cells["certain", "with", "detection_rate_percent", "all"] == pytest.approx(20)
    assert cells["printed", "without", "position_error_m", "rmse"] == pytest.approx(0)


def test_intervals_hold_their_value_and_two_sequences_count_as_one(recording):
    shifts_m = np.random.default_rng(0).uniform(0, 0.01, 120)
    estimates = [answer(recording, 5000 * k, shift_m) for k, shift_m in enumerate(shifts_m)]
    table = pose_errors.errors(recording, estimates, Port.lm_map())
    cells = pose_errors.summary([table, table], draws=200)
    exact = cells[(cells.variant == "exact") & (cells.outlier_filter == "without")]
    assert (exact.low <= exact.value + 1e-12).all() and (exact.value <= exact.high + 1e-12).all()
    median = exact[(exact.metric == "position_error_m") & (exact.statistic == "median")].value.item()
    assert median == pytest.approx(table.position_error_m.median())
    pd.testing.assert_frame_equal(cells, pose_errors.summary([table, table], draws=200))
