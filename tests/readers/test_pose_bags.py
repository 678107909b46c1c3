"""Laws of bags of poses: what was estimated is what ROS reads, in its frames, order and units."""

import errno
from dataclasses import replace

import drawn
import numpy as np
import pytest
from hypothesis import given
from rosbags import rosbag1
from rosbags.highlevel import AnyReader
from scipy.spatial.transform import Rotation
from strategies import facing_pose, seeds
from test_journal import some_estimates

from lmmap.geometry.rotations import step_between
from lmmap.recordings.pose_files import read_estimates
from lmmap.types import Estimate, InputError, Pose, Status
from lmmap_readers.pose_bags import STORES, TOPICS, PoseBag, messages

both = pytest.mark.parametrize("name", ["poses.bag", "poses.mcap"])


def read(path):
    """``(topic, time in us, message)`` of a bag, by its own definitions."""
    with AnyReader([path]) as bag:
        return [(c.topic, t_ns // 1000, bag.deserialize(raw, c.msgtype)) for c, t_ns, raw in bag.messages()]


def pose_of(place, turn) -> Pose:
    return Pose(Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).as_matrix(), [place.x, place.y, place.z])


def time_us(stamp) -> int:
    return stamp.sec * 10**6 + stamp.nanosec // 1000


def write(path, estimates, *names):
    with PoseBag(path, *names) as bag:
        for e in estimates:
            bag.add(e)
    assert bag.statuses == [str(e.status) for e in estimates]


@both
def test_reported_poses_come_back_on_both_topics_in_the_frames_that_were_named(tmp_path, name, rng):
    estimates = [replace(e, covariance=np.cov(rng.standard_normal((6, 9)))) for e in some_estimates(12, 3)]
    guess = Estimate(7, Status.PREDICTED, facing_pose(0.1, 0.2, 0.3, (0.0, 0.0, 0.5)))
    reported = [e for e in estimates if e.status == Status.OK]
    write(tmp_path / name, [guess, *estimates], "left/optical", "target")
    told = read(tmp_path / name)
    assert [(topic, t_us) for topic, t_us, _ in told] == [(t, e.t_us) for e in reported for t in TOPICS]
    for e, (_, _, posed), (_, _, tf) in zip(reported, told[::2], told[1::2], strict=True):
        (link,) = tf.transforms
        for header in (posed.header, link.header):
            assert time_us(header.stamp) == e.t_us and header.frame_id == "left/optical"
        assert link.child_frame_id == "target"
        pose, move = posed.pose.pose, link.transform
        for T in (pose_of(pose.position, pose.orientation), pose_of(move.translation, move.rotation)):
            np.testing.assert_allclose(T.position_m, e.T_cam_port.position_m, atol=1e-15)
            np.testing.assert_allclose(T.rotation, e.T_cam_port.rotation, atol=1e-12)
        np.testing.assert_array_equal(posed.pose.covariance.reshape(6, 6), e.covariance)


@given(seeds())
def test_the_covariance_is_that_of_turns_about_the_fixed_axes_of_the_cameras_frame(seed):
    """A pose moved as ROS defines it is as far by the message's covariance as by the estimate's, in which
    a track measures (`rotations.step_between`)."""
    rng = np.random.default_rng(seed)
    T, S = facing_pose(*rng.uniform(0, 1, 3), (0.1, 0.0, 0.5)), np.cov(rng.standard_normal((6, 9)))
    posed, _ = messages(Estimate(5, Status.OK, T, covariance=S), STORES[".mcap"].types, "camera", "port")
    step = 1e-5 * rng.standard_normal(6)
    pose = pose_of(posed.pose.pose.position, posed.pose.pose.orientation)
    turn = Rotation.from_euler("xyz", step[3:]).as_matrix()  # small letters: about fixed axes, one by one
    moved = Pose(turn @ pose.rotation, pose.position_m + step[:3])
    y = step_between(T, moved)
    told = step @ np.linalg.solve(posed.pose.covariance.reshape(6, 6), step)
    assert told == pytest.approx(y @ np.linalg.solve(S, y), rel=1e-3)


@both
@pytest.mark.parametrize("old", [True, False])
def test_an_error_leaves_the_old_file_or_else_keeps_what_was_estimated(tmp_path, name, old):
    path = tmp_path / name
    if old:
        path.write_text("old")
    estimates = [e for e in some_estimates(9, 1) if e.status == Status.OK]
    with pytest.raises(InputError, match="damaged"), PoseBag(path) as bag:
        for e in estimates:
            bag.add(e)
        raise InputError("run.raw: damaged")
    assert path.read_text() == "old" if old else len(read(path)) == 2 * len(estimates)
    assert [p.name for p in tmp_path.iterdir()] == [name]


@both
def test_a_recording_without_a_pose_is_a_bag_without_a_message(tmp_path, name):
    write(tmp_path / name, [Estimate(5, Status.NO_RING)])
    assert read(tmp_path / name) == []


def test_a_full_disk_is_one_line_and_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "poses.bag"
    path.write_text("old")
    for method in ("write", "close"):
        whole = getattr(rosbag1.Writer, method)

        def full(*arguments, whole=whole):
            whole(*arguments)
            raise OSError(errno.ENOSPC, "No space left on device")

        with monkeypatch.context() as patched:
            patched.setattr(rosbag1.Writer, method, full)
            with pytest.raises(InputError, match=r"poses\.bag: cannot write \(No space left"):
                write(path, [e for e in some_estimates(9, 1) if e.status == Status.OK])
    assert path.read_text() == "old" and [p.name for p in tmp_path.iterdir()] == ["poses.bag"]


@pytest.mark.parametrize("names", [("/camera", "port"), ("camera", ""), ("a b", "port"), ("port", "port")])
def test_names_that_tf2_refuses(tmp_path, names):
    with pytest.raises(InputError, match=r"--child-frame-id.*: give two names"):
        PoseBag(tmp_path / "poses.bag", *names)


@both
@pytest.mark.parametrize("t_us", [-1, 2**31 * 10**6])
def test_times_that_ros_does_not_have_leave_the_old_file(tmp_path, name, t_us):
    (tmp_path / name).write_text("old")
    with pytest.raises(InputError, match=f"{name}: a time of {t_us} us, .*csv"):
        write(tmp_path / name, [Estimate(t_us, Status.OK, facing_pose(0.1, 0.2, 0.3, (0.0, 0.0, 0.5)))])
    assert (tmp_path / name).read_text() == "old"


@both
def test_the_command_writes_the_poses_that_it_writes_as_a_table(tmp_path, lmmap, name):
    command = ["estimate", drawn.file(4), "--modality", "rgb", "-o"]
    table, bag = tmp_path / "poses.csv", tmp_path / name
    assert lmmap(*command, table)[0] == lmmap(*command, bag, "--frame-id", "eye")[0] == 0
    reported = [e for e in read_estimates(table) if e.status == Status.OK]
    told = read(bag)
    assert len(reported) > 0 and len(told) == 2 * len(reported)
    for e, (_, t_us, posed) in zip(reported, told[::2], strict=True):
        assert t_us == time_us(posed.header.stamp) == e.t_us and posed.header.frame_id == "eye"
        np.testing.assert_allclose(posed.pose.covariance[::7], np.diag(e.covariance), rtol=1e-6)
        np.testing.assert_allclose(posed.pose.pose.position.z, e.T_cam_port.position_m[2], rtol=1e-9)


@both
def test_an_interrupted_command_keeps_the_bag_so_far(tmp_path, lmmap, name, monkeypatch):
    def stop(self, estimate):
        self.images += 1
        if self.images == 2:
            raise KeyboardInterrupt

    monkeypatch.setattr("lmmap.cli.estimation.Bar.add", stop)
    code, _, err = lmmap("estimate", drawn.file(4), "--modality", "rgb", "-o", tmp_path / name)
    assert code == 130 and err.endswith(f"{name} keeps what was estimated\n")
    assert len(read(tmp_path / name)) == 4 and [p.name for p in tmp_path.iterdir()] == [name]


def test_what_a_bag_cannot_do_is_one_line(tmp_path, lmmap):
    command = ["estimate", drawn.file(4), "--modality", "event"]
    for words, answer in (
        (["-o", tmp_path / "p.mcap", "--resume"], "a bag cannot be resumed"),
        (["-o", tmp_path / "p.mcap", "--track", "--between", "50"], "cannot mark poses"),
        (["-o", tmp_path / "p.bag", "--frame-id", "/a"], "give two names"),
        (["-o", tmp_path / "p.bag", "--frame-id", "a\udcff"], "give two names"),
        (["-o", tmp_path / "p.csv", "--frame-id", "a"], "frames have names in bags only"),
    ):
        code, out, err = lmmap(*command, *words)
        assert code == 1 and out == "" and answer in err and err.count("\n") == 1
    assert not list(tmp_path.iterdir())


@both
def test_live_poses_are_written_as_well(tmp_path, lmmap, name):
    assert lmmap("live", drawn.file(4), "--modality", "rgb", "-o", tmp_path / name)[0] == 0
    assert {topic for topic, *_ in read(tmp_path / name)} == set(TOPICS)
