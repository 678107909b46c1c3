"""Laws of the odometry comparison: symmetry, scale and a perfect estimate leave no error."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from lmmap.geometry.rotations import rotation_z
from lmmap.recordings.pose_files import write_trajectory
from lmmap.types import Estimate, Port, Pose, Status, Trajectory
from lmmap_lab.studies import odometry

PORT = Port.lm_map()


def track(count=120, seed=0) -> Trajectory:
    """A smooth walk in front of the port, 10 poses a second."""
    rng, s = np.random.default_rng(seed), np.linspace(0, 1, count)[:, None]
    waves = np.sin(2 * np.pi * rng.uniform(0.5, 2, 6) * s + rng.uniform(0, 6, 6))
    turn = Rotation.from_rotvec(np.pi * np.array([1, 0, 0])) * Rotation.from_rotvec(0.3 * waves[:, :3])
    yaw = Rotation.from_rotvec(np.column_stack([0 * s, 0 * s, 4 * s]))
    return Trajectory(
        100_000 * np.arange(count), Pose((turn * yaw).as_matrix(), 0.1 * waves[:, 3:] + [0, 0, 0.6])
    )


def as_estimates(trajectory: Trajectory) -> list[Estimate]:
    poses = (trajectory.poses[k] for k in range(len(trajectory)))
    return [Estimate(t, Status.OK, T) for t, T in zip(trajectory.t_us.tolist(), poses, strict=True)]


def turned(trajectory: Trajectory, turns) -> Trajectory:
    T = trajectory.poses
    return Trajectory(
        trajectory.t_us, Pose(T.rotation @ rotation_z(PORT.yaw_period_rad * turns), T.position_m)
    )


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32))
def test_continuous_yaw_undoes_any_choice_of_markers(seed):
    original = track(seed=seed)
    turns = np.random.default_rng(seed).integers(0, 3, len(original))
    back = odometry.continuous_yaw(turned(original, turns), PORT.yaw_period_rad)
    expected = turned(original, np.full(len(original), turns[0]))
    np.testing.assert_allclose(back.poses.rotation, expected.poses.rotation, atol=1e-9)
    np.testing.assert_array_equal(back.poses.position_m, original.poses.position_m)


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 2**32))
def test_the_nearest_yaw_is_the_references(seed):
    truth = track(seed=seed)
    turns = np.random.default_rng(seed).integers(0, 3, len(truth))
    back = odometry.nearest_yaw(turned(truth, turns), cut(truth, 3, 90), PORT.yaw_period_rad)
    np.testing.assert_array_equal(back.t_us, truth.t_us[3:90])
    np.testing.assert_allclose(back.poses.rotation, truth.poses.rotation[3:90], atol=1e-9)


@pytest.mark.parametrize("count", [0, 1])
def test_continuous_yaw_of_almost_nothing(count):
    few = track(5)
    few = Trajectory(few.t_us[:count], few.poses[:count])
    assert len(odometry.continuous_yaw(few, PORT.yaw_period_rad)) == count


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32), st.floats(0.2, 5))
def test_scaled_and_ambiguous_truth_has_no_error(seed, scale):
    """Scale is aligned and yaw's multiple cancels: what is left of the camera's true path is nothing."""
    truth = track(seed=seed)
    T_port_cam = truth.poses.inverse
    scaled = Pose(T_port_cam.rotation, scale * T_port_cam.position_m).inverse
    turns = np.random.default_rng(seed).integers(0, 3, len(truth))
    estimated = odometry.camera_track(as_estimates(turned(Trajectory(truth.t_us, scaled), turns)), PORT)
    table = odometry.score([estimated], truth)
    assert len(table) and table.position_error_m.max() < 1e-9 and table.rotation_error_deg.max() < 1e-6


def test_noise_shows_as_much_as_it_is():
    """Independent errors of s in each coordinate at both ends: RMS s sqrt(6), at every length."""
    truth, sigma = track(400), 0.001
    rng = np.random.default_rng(0)
    T_port_cam = truth.poses.inverse
    noisy = Pose(T_port_cam.rotation, T_port_cam.position_m + rng.normal(0, sigma, (400, 3))).inverse
    table = odometry.score([Trajectory(truth.t_us, noisy)], truth)
    rms = table.groupby("length_m").position_error_m.apply(lambda e: np.sqrt((e**2).mean()))
    assert len(rms) == len(odometry.FRACTIONS)
    np.testing.assert_allclose(rms, sigma * np.sqrt(6), rtol=0.2)


def cut(trajectory, start, stop=None) -> Trajectory:
    return Trajectory(trajectory.t_us[start:stop], trajectory.poses[start:stop])


def test_the_reference_is_interpolated():
    """A reference at a third of the rate, beside the track's times, costs next to nothing."""
    truth = track(1200)
    coarse = Trajectory(truth.t_us[::3], truth.poses[::3])
    table = odometry.score([cut(truth, 1, 1195)], coarse)
    assert table.position_error_m.max() < 1e-4


def test_each_track_has_its_own_scale_and_place():
    truth = track(400)
    T = truth.poses[200:].inverse
    elsewhere = Pose(np.diag([1.0, -1, -1]), np.array([1.0, 2, 3])) @ Pose(T.rotation, 7 * T.position_m)
    second = Trajectory(truth.t_us[200:], elsewhere.inverse)
    table = odometry.score([cut(truth, 0, 200), second], truth)
    assert set(table.track) == {0, 1} and table.position_error_m.max() < 1e-9


def test_a_short_track_is_left_out_beside_a_long_one():
    truth = track(400)
    table = odometry.score([cut(truth, 0, 39), cut(truth, 50)], truth)
    assert set(table.track) == {1}


def test_why_a_trajectory_has_no_score():
    truth = track(400)
    line = Pose(np.tile(np.eye(3), (400, 1, 1)), np.outer(np.arange(400.0), [1, 0, 0]))
    cases = {
        "holds no pose": [],
        "outside the reference's": [Trajectory(truth.t_us + 10**9, truth.poses)],
        "too short: 39 poses": [cut(truth, 0, 39)],
        "lie on a line": [Trajectory(truth.t_us, line)],
        "no stretch of path reaches": [Trajectory(1000 * np.arange(60), truth.at(1000 * np.arange(60)))],
    }
    for reason, tracks in cases.items():
        with pytest.raises(odometry.NotScored, match=reason):
            odometry.score(tracks, truth)
    with pytest.raises(odometry.NotScored, match="reference holds no pose"):
        odometry.score([truth], cut(truth, 0, 0))


def test_tracks_are_read_as_they_were_cut(tmp_path):
    truth, path = track(90), tmp_path / "a.tum"
    write_trajectory(truth, path, "tum")
    assert [len(t) for t in odometry.read_tracks(path)] == [90]
    lines = path.read_text().splitlines()
    lines = ["# anything", "# track 1", *lines[:30], "", "# track 2", *lines[30:70], "# track 3", *lines[70:]]
    path.write_text("\n".join(lines))
    parts = odometry.read_tracks(path)
    assert [len(t) for t in parts] == [30, 40, 20]
    np.testing.assert_array_equal(np.concatenate([t.t_us for t in parts]), truth.t_us)
    path.write_text("# track 1\n")
    assert odometry.read_tracks(path) == []


def test_path_length_by_hand():
    """Along z by 1 m, then sideways by 2 m, never turning."""
    T = Pose(np.tile(np.eye(3), (3, 1, 1)), [[0, 0, 1.0], [0, 0, 2], [2, 0, 2]])
    assert odometry.path_length_m(Trajectory([0, 1, 2], T)) == pytest.approx(3.0)


def results(folder, evo=False):
    """Runs of two methods: one perfect, one that crashed before its first pose."""
    folder.mkdir()
    truth, rows = track(400), []
    for sequence in odometry.SEQUENCES:
        write_trajectory(truth, folder / f"truth-{sequence}.tum", "tum")
        for method, outcome, frames in (("lmmap", "finished", 400), ("SVO", "crashed, signal 11", None)):
            name = f"{method}-{sequence}.tum"
            write_trajectory(truth if frames else cut(truth, 0, 0), folder / name, "tum")
            counts = dict.fromkeys(odometry.COUNTS, frames and 0)
            counts |= {"frames": frames, "tracked": frames}
            rows.append({"method": method, "modality": "rgb", "sequence": sequence, "run": 0, "start_s": 0.0,
                         "outcome": outcome, **counts, "file": name})  # fmt: skip
        if evo:
            write_trajectory(truth, folder / f"EVO-event-{sequence}.tum", "tum")
    pd.DataFrame(rows).to_csv(folder / "runs.csv", index=False)
    return folder


def test_a_crash_is_a_row(tmp_path):
    log, table = odometry.benchmark(results(tmp_path / "r"))
    assert table.position_error_m.max() < 1e-9 and set(table.method) == {"lmmap"}
    assert (log[log.method == "SVO"].not_scored != "").all()
    rows = odometry.summary(log, table).set_index(["sequence", "method", "modality"])
    svo = rows.loc[("test-high", "SVO", "rgb")]
    assert (svo.runs, svo.failed, svo.scored) == (1, 1, 0) and np.isnan(svo.median_m)
    ours = rows.loc[("test-high", "lmmap", "rgb")]
    assert (ours.runs, ours.failed, ours.scored, ours.tracked_percent) == (1, 0, 1, 100)
    assert rows.loc[("test-high", "EVO", "event")].outcome == "not run here"
    assert rows.loc[("test-high", "ORB-SLAM3", "rgb")].outcome == "not run here"


def test_a_user_s_trajectory_of_evo_takes_its_row(tmp_path):
    log, table = odometry.benchmark(results(tmp_path / "r", evo=True))
    rows = odometry.summary(log, table).set_index(["sequence", "method", "modality"])
    for sequence in odometry.SEQUENCES:
        evo = rows.loc[(sequence, "EVO", "event")]
        assert evo.outcome == "run" and evo.median_m < 1e-6


def test_the_committed_runs_are_whole():
    """Each track has its file, in the log's numbers, and every method, modality and sequence its runs."""
    log = odometry.runs()
    for run in log.to_dict("records"):
        tracks = odometry.read_tracks(odometry.FOLDER / run["file"])
        if run["outcome"] == "finished":
            assert len(tracks) == run["tracks"] and sum(map(len, tracks)) == run["tracked"]
            assert run["initialising"] + run["tracked"] + run["lost"] == run["frames"]
    theirs = log[log.method.isin(["ORB-SLAM3", "SVO"])]
    counts = theirs.groupby(["method", "modality", "sequence"]).start_s.agg(["size", "nunique"])
    assert len(counts) == 2 * len(odometry.MODALITIES) * len(odometry.SEQUENCES)
    assert counts["size"].nunique() == 1 and counts["size"].min() >= 5 and counts["nunique"].min() >= 3
    ours = log[log.method == "lmmap"]
    assert len(ours) == len(odometry.MODALITIES) * len(odometry.SEQUENCES)
