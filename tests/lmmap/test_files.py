"""Laws of writing: whole or not at all, through links, into devices and pipes, and nothing left behind."""

import os
import stat

import drawn
import numpy as np
import pytest
from strategies import facing_pose

from lmmap import disk
from lmmap.camera_files import write_fields
from lmmap.drawing.video import Video
from lmmap.files import atomic, check_output, lock, temporary, write_text
from lmmap.marks import check_same
from lmmap.recordings.journal import Journal
from lmmap.recordings.pose_files import write_estimates, write_trajectory
from lmmap.types import Camera, Estimate, InputError, Pose, Status
from lmmap_readers.pose_bags import PoseBag
from lmmap_readers.rig import Rig

E = Estimate(5, Status.OK, facing_pose(0.1, 0.2, 0.3, (0.0, 0.0, 0.5)))


def poses(kind, *options):
    def write(path):
        with kind(path, *options) as output:
            output.add(E)

    return write


def video(path):
    with Video(path) as film:
        for k in range(3):
            film.add(np.full((48, 64, 3), 40 * k, np.uint8), 10.0)


WRITERS = {
    "p.csv": poses(Journal),
    "p.tum": poses(Journal, "tum"),
    "p.bag": poses(PoseBag),
    "p.mcap": poses(PoseBag),
    "o.mp4": video,
    "o.avi": video,
    "camera.json": lambda path: write_fields(path, Camera.davis346()),
    "rig.json": lambda path: Rig("base", "tool", Pose.identity(), Pose.identity(), 0.08).save(path),
    "truth.csv": lambda path: write_trajectory(drawn.recording(3).truth, path),
    "estimates.csv": lambda path: write_estimates([E], path),
    "notes.txt": lambda path: write_text(path, "notes"),
}
every_writer = pytest.mark.parametrize("name", WRITERS)


def names(folder) -> set[str]:
    return {path.name for path in folder.iterdir()}


@every_writer
def test_a_link_stays_and_what_it_names_is_written(tmp_path, name):
    (tmp_path / "real").mkdir()
    target, link = tmp_path / "real" / name, tmp_path / name
    target.write_text("old")
    link.symlink_to(target)
    WRITERS[name](link)
    assert link.is_symlink() and target.read_bytes() != b"old" and names(tmp_path / "real") == {name}


@every_writer
def test_a_pipe_gets_everything_and_stays_one(tmp_path, name):
    path, plain = tmp_path / name, tmp_path / "plain" / name
    os.mkfifo(path)
    plain.parent.mkdir()
    with open(os.open(path, os.O_RDONLY | os.O_NONBLOCK), "rb") as reader:
        WRITERS[name](path)
        come = reader.read()
    WRITERS[name](plain)
    assert stat.S_ISFIFO(path.stat().st_mode) and names(tmp_path) == {name, "plain"}
    varies = ("p.bag", "p.mcap", "o.mp4", "o.avi")  # their containers hold the time of writing
    assert come == plain.read_bytes() or (name in varies and len(come) == plain.stat().st_size)


@every_writer
def test_a_pipe_that_nobody_reads_is_refused_at_once(tmp_path, name):
    os.mkfifo(tmp_path / name)
    with pytest.raises(InputError, match="no program reads this pipe"):
        WRITERS[name](tmp_path / name)
    assert stat.S_ISFIFO((tmp_path / name).stat().st_mode)


@every_writer
def test_a_device_stays_one(tmp_path, name):
    path = tmp_path / name
    try:
        os.mknod(path, stat.S_IFCHR | 0o600, os.makedev(1, 3))
    except OSError:
        path.symlink_to(os.devnull)
    WRITERS[name](path)
    assert stat.S_ISCHR(path.stat().st_mode) and names(tmp_path) == {name}


def test_an_error_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "p.json"
    for old, keep in (("old", False), ("old", True), (None, False), (None, True)):
        if old:
            path.write_text(old)
        with pytest.raises(KeyError), atomic(path, keep) as part:
            part.write_text("new")
            raise KeyError
        kept = old or ("new" if keep else None)
        assert names(tmp_path) == ({path.name} if kept else set())
        assert kept is None or path.read_text() == kept
        path.unlink(missing_ok=True)


def test_the_disks_errors_are_one_line_and_keep_nothing(tmp_path):
    with (
        pytest.raises(InputError, match=r"p\.json: cannot write \(.*; choose"),
        atomic(tmp_path / "p.json", True) as part,
    ):
        part.write_text("new")
        (tmp_path / "none" / "x").write_text("")
    assert not names(tmp_path)


def test_two_that_write_one_file_at_once(tmp_path):
    with atomic(tmp_path / "p.json") as part:
        part.write_text("first")
        with pytest.raises(InputError, match=r"p\.json: another process"), atomic(tmp_path / "p.json"):
            pass
        assert part.read_text() == "first"
    with temporary(tmp_path / "p.json"), lock(tmp_path / "p.json"):
        pass  # the lock of a command, and that of a file which it writes
    assert (tmp_path / "p.json").read_text() == "first"


@pytest.mark.parametrize("name", [300 * "n", 252 * "n" + ".h5"])
def test_names_that_the_disk_cannot_have(tmp_path, name):
    for refuses in (check_output, WRITERS["p.csv"], WRITERS["p.bag"], lambda path: write_text(path, "")):
        with pytest.raises(InputError, match="File name too long"):
            refuses(tmp_path / name)


def test_an_output_that_is_not_there_yet_may_be_an_input_by_another_name(tmp_path):
    """As two outputs of one command."""
    (tmp_path / "f").mkdir()
    (tmp_path / "g").symlink_to(tmp_path / "f")
    with pytest.raises(InputError, match="is also read as"):
        check_output(tmp_path / "f" / "p.mp4", [tmp_path / "g" / "p.mp4"])


def test_what_differs_is_named(tmp_path):
    check_same("x", {"a": 1, "b": [2]}, {"a": 1, "b": (2,)})
    with pytest.raises(
        InputError, match="another b and c; give the same recording and settings, or another name"
    ):
        check_same("x", {"a": 1, "b": 2}, {"a": 1, "b": 3, "c": 0})


def test_what_a_killed_run_left_beside_a_finished_file_is_removed(tmp_path):
    (tmp_path / ".poses.csv.writing").touch()
    assert not disk.is_there(tmp_path / "poses.csv")
    (tmp_path / "poses.csv").write_text("whole")
    assert disk.is_there(tmp_path / "poses.csv") and [p.name for p in tmp_path.iterdir()] == ["poses.csv"]
