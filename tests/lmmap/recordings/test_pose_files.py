"""Laws of trajectory and estimate files."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from lmmap.recordings.columns import COLUMNS, PREFIXES, TABLE
from lmmap.recordings.pose_files import (
    read_estimates,
    read_trajectory,
    read_truth,
    trajectory_of,
    write_estimates,
    write_trajectory,
)
from lmmap.types import Ellipse, Estimate, InputError, Pose, Status, Trajectory


def poses(rng, *shape) -> Pose:
    rotations = Rotation.random(int(np.prod(shape)), rng=rng).as_matrix()
    return Pose(rotations.reshape(*shape, 3, 3), rng.normal(size=(*shape, 3)))


def assert_same_pose(a: Pose, b: Pose):
    np.testing.assert_allclose(a.rotation, b.rotation, atol=1e-9)
    np.testing.assert_allclose(a.position_m, b.position_m, atol=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32), st.integers(0, 20), st.integers(0, 2 * 10**15), st.sampled_from(["csv", "tum"]))
def test_trajectory_round_trip(tmp_path_factory, seed, count, start_us, form):
    rng = np.random.default_rng(seed)
    original = Trajectory(start_us + np.cumsum(rng.integers(1, 10**5, count)), poses(rng, count))
    path = tmp_path_factory.mktemp("t") / ("t.tum" if form == "tum" else "t.csv")
    write_trajectory(original, path, form)
    back = read_trajectory(path)
    np.testing.assert_array_equal(back.t_us, original.t_us)
    assert_same_pose(back.poses, original.poses)


def test_tum_is_the_camera_in_the_ports_frame(tmp_path):
    """By hand: a port 2 m ahead, facing us (turned by 180 deg about x): the camera is at z = 2 m of it."""
    T_cam_port = Pose([np.diag([1.0, -1, -1])], [[0, 0, 2.0]])
    write_trajectory(Trajectory([1_500_000], T_cam_port), tmp_path / "t.tum", "tum")
    values = [float(v) for v in (tmp_path / "t.tum").read_text().split()]
    np.testing.assert_allclose(np.abs(values), [1.5, 0, 0, 2, 1, 0, 0, 0], atol=1e-12)
    assert values[3] == 2


def estimates(seed) -> list[Estimate]:
    rng = np.random.default_rng(seed)
    a, b, c = (poses(rng) for _ in range(3))
    root = rng.normal(size=(6, 6)) * [1e-3, 1e-3, 1e-2, 0.1, 0.1, 0.01]
    ellipse = Ellipse(rng.uniform(0, 300, 2), np.sort(rng.uniform(10, 90, 2))[::-1], rng.uniform(0, 3))
    return [
        Estimate(5, Status.NO_RING),
        Estimate(
            10**15,
            Status.OK,
            a,
            b,
            c,
            ellipse,
            *rng.random(5),
            covariance=root @ root.T,
            confidence=rng.random(),
        ),
        Estimate(10**15 + 7, Status.OK, b),
        Estimate(10**15 + 9, Status.NO_MARKERS, ellipse=ellipse, arc_coverage=0.75, ring=a, twin=c),
        Estimate(10**15 + 11, Status.UNSURE, doubtful=b, confidence=0.5),
    ]


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32))
def test_estimates_round_trip(tmp_path_factory, seed):
    path = tmp_path_factory.mktemp("e") / "poses.csv"
    original = estimates(seed)
    write_estimates(original, path)
    back = read_estimates(path)
    for a, b in zip(original, back, strict=True):
        assert (a.t_us, a.status) == (b.t_us, b.status)
        for name in PREFIXES:
            assert (getattr(a, name) is None) == (getattr(b, name) is None)
            if getattr(a, name) is not None:
                assert_same_pose(getattr(a, name), getattr(b, name))
        assert (a.covariance is None) == (b.covariance is None)
        if a.covariance is not None:
            np.testing.assert_allclose(b.covariance, a.covariance, rtol=1e-7)
        assert (a.ellipse is None) == (b.ellipse is None)
        if a.ellipse is not None:
            np.testing.assert_allclose(a.ellipse.points(5), b.ellipse.points(5), atol=1e-4)
        np.testing.assert_allclose(
            [a.arc_coverage, a.marker_score, a.rival_score, a.margin, a.tilt_sigmas, a.confidence],
            [b.arc_coverage, b.marker_score, b.rival_score, b.margin, b.tilt_sigmas, b.confidence],
            atol=1e-5,
        )


def test_first_columns_of_poses_csv(tmp_path):
    write_estimates(estimates(0), tmp_path / "poses.csv")
    head, first, *_ = (tmp_path / "poses.csv").read_text().splitlines()
    assert head.startswith("t_us,status,x_m,y_m,z_m,qx,qy,qz,qw,arc_coverage,marker_score,rival_score")
    assert first.startswith("5,no_ring,,,,,,,,0,0,0")


def test_trajectory_of_keeps_the_poses(tmp_path):
    trajectory = trajectory_of(estimates(3))
    assert trajectory.t_us.tolist() == [10**15, 10**15 + 7]
    assert_same_pose(trajectory.poses[0], estimates(3)[1].T_cam_port)
    assert len(trajectory_of([])) == 0


@pytest.mark.parametrize(
    "text, words",
    [
        ("", "no column t_us"),
        ("a,b\n1,2\n", "no column t_us"),
        ("t_us,x_m,y_m,z_m,qx,qy,qz,qw\n1,2,3\n", "different length"),
        ("t_us,x_m,y_m,z_m,qx,qy,qz,qw\n1,0,0,nan,0,0,0,1\n", "not finite"),
        ("t_us,x_m,y_m,z_m,qx,qy,qz,qw\n1,0,0,1,0,0,0,2\n", "unit length"),
        ("t_us,x_m,y_m,z_m,qx,qy,qz,qw\n1,0,0,1,0,0,0,1\n1,0,0,1,0,0,0,1\n", "increase"),
        ("t_us,x_m,y_m,z_m,qx,qy,qz,qw\none,0,0,1,0,0,0,1\n", "one"),
    ],
)
def test_bad_trajectories_are_named(tmp_path, text, words):
    path = tmp_path / "t.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=words) as caught:
        read_trajectory(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def some_truth(step_us, start_us=0, count=60) -> Trajectory:
    return Trajectory(start_us + step_us * np.arange(count), poses(np.random.default_rng(0), count))


@pytest.mark.parametrize("form, own", [("csv", "us"), ("tum", "s")])
@pytest.mark.parametrize("step_us, unit", [(50_000, "ns"), (8333, "ns"), (20_000, "us"), (10_000, "ms")])
def test_a_truth_in_another_unit_is_named(tmp_path, form, own, step_us, unit):
    """The file's numbers are times in a unit, taken as microseconds in CSV and as seconds in TUM."""
    if unit == own:
        return
    per_us = {"ns": 1000, "us": 1, "ms": 1e-3}[unit]
    write_trajectory(some_truth(step_us), tmp_path / f"t.{form}", form)
    lines = (tmp_path / f"t.{form}").read_text().splitlines()
    for k in range(form == "csv", len(lines)):
        time, sign, rest = lines[k].partition("," if form == "csv" else " ")
        t_us = float(time) * (1 if form == "csv" else 1e6)
        lines[k] = f"{round(t_us * per_us)}{sign}{rest}"
    (tmp_path / f"t.{form}").write_text("\n".join(lines) + "\n")
    with pytest.raises(
        InputError, match=rf"t\.{form}: its poses are .* s apart, with times in {own}; .*in.* {unit}"
    ):
        read_truth(tmp_path / f"t.{form}")


@pytest.mark.parametrize("start_us", [0, 1_700_000_000_000_000])
@pytest.mark.parametrize("step_us", [1000, 5000, 33_333, 500_000])
@pytest.mark.parametrize("form", ["csv", "tum"])
def test_a_sound_truth_is_not_noted(tmp_path, start_us, step_us, form):
    write_trajectory(some_truth(step_us, start_us), tmp_path / f"t.{form}", form)
    assert read_truth(tmp_path / f"t.{form}").t_us[1] == start_us + step_us


def test_a_truth_of_seconds_is_said_and_one_of_minutes_refused(tmp_path):
    write_trajectory(some_truth(2_000_000), tmp_path / "t.tum", "tum")
    with pytest.warns(UserWarning, match="2 s apart.*if they are in ms, write them in s"):
        read_truth(tmp_path / "t.tum")
    write_trajectory(some_truth(60_000_000, count=2), tmp_path / "t.tum", "tum")
    with pytest.raises(InputError, match="60 s apart"):
        read_truth(tmp_path / "t.tum")


def test_what_a_truth_is_its_beginning_says(tmp_path):
    """Written as CSV under a name that TUM's files have, it is read as CSV."""
    truth = some_truth(10_000)
    write_trajectory(truth, tmp_path / "t.txt", "csv")
    np.testing.assert_array_equal(read_truth(tmp_path / "t.txt").t_us, truth.t_us)
    write_trajectory(truth, tmp_path / "u.txt", "tum")
    assert_same_pose(read_truth(tmp_path / "u.txt").poses, truth.poses)


def test_estimates_as_a_truth_are_said(tmp_path):
    steps = [Estimate(k * 10_000, Status.OK, poses(np.random.default_rng(k))) for k in range(9)]
    steps += [Estimate(90_000, Status.NO_RING), Estimate(100_000, Status.PREDICTED, steps[0].T_cam_port)]
    write_estimates(steps, tmp_path / "p.csv")
    with pytest.warns(UserWarning, match=r"p\.csv: is a table of estimates"):
        assert read_truth(tmp_path / "p.csv").t_us.tolist() == list(range(0, 90_000, 10_000))


def test_bad_tables_and_absent_files(tmp_path):
    (tmp_path / "e.csv").write_text("t_us,status\n1,ok\n")
    (tmp_path / "t.tum").write_text("1.0 2 3\n")
    for read, name in (
        (read_estimates, "e.csv"),
        (read_estimates, "x"),
        (read_trajectory, "t.tum"),
        (read_trajectory, "x.csv"),
    ):
        with pytest.raises(InputError, match=name):
            read(tmp_path / name)
    with pytest.raises(ValueError, match="format"):
        write_trajectory(trajectory_of([]), tmp_path / "t", "bag")


def test_every_column_has_its_unit_and_meaning():
    """Quaternions and scores have the unit 1; a time and a status have no frame but the clock."""
    assert len(set(COLUMNS)) == len(COLUMNS) == 2 + 6 * 7 + 3 + 5 + 3 + 1 + 21
    for names, unit, frame, meaning in TABLE:
        assert meaning and (unit or names == ("status",))
        suffixes = {"m": "_m", "us": "_us", "px": "_px", "rad": "_rad"}
        if unit in suffixes:
            assert all(name.endswith(suffixes[unit]) for name in names)
        if set(names) & {"x_m", "qx", "ring_x_m", "cov_x_x"}:
            assert frame == "camera"
