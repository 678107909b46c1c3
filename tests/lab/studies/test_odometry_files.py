"""Exchange with other odometries: what is exported reads back, and bad trajectories get one clear line."""

import json
import os
import resource
import shutil

import cv2
import numpy as np
import pytest
from attack_checks import snapshot
from rosbags.rosbag1 import Reader
from rosbags.typesys import Stores, get_typestore
from test_odometry import track

from lmmap.cli import main
from lmmap.pipeline.histograms import histogram
from lmmap.recordings.formats import open_recording
from lmmap.recordings.pose_files import read_trajectory, write_trajectory
from lmmap.types import Camera, InputError, Recording
from lmmap_lab.bench.writers import write_recording
from lmmap_lab.provenance import DATA
from lmmap_lab.studies import odometry_files

MINI = DATA / "mini" / "test-low.aedat4"


@pytest.fixture(scope="module")
def mini() -> Recording:
    return open_recording(MINI)


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("vo") / "new" / "export"
    assert main.main(["odometry", "export", str(MINI), str(folder)]) == 0
    return folder


def images(folder, modality):
    lines = [line.split() for line in (folder / f"{modality}.txt").read_text().splitlines()[1:]]
    return [
        (round(float(t) * 1e6), cv2.imread(str(folder / path), cv2.IMREAD_UNCHANGED)) for t, path in lines
    ]


def test_frames_are_exported_as_recorded(exported, mini):
    times, frames = zip(*images(exported, "rgb"), strict=True)
    assert list(times) == mini.frames_t_us.tolist()
    np.testing.assert_array_equal(np.stack(frames)[..., ::-1], mini.frames)


def test_event_frames_come_at_the_rate_of_frames(exported, mini):
    times, frames = zip(*images(exported, "event"), strict=True)
    assert frames[0].shape == mini.frames.shape[1:3] and frames[0].dtype == np.uint8
    assert min(np.diff(times)) > 0
    span_s = (mini.events["t_us"][-1] - times[0]) * 1e-6
    assert len(times) == pytest.approx(odometry_files.FRAME_HZ * span_s, abs=3)


def test_the_bag_holds_the_recording(exported, mini):
    back = open_recording(exported / "recording.bag", mini.camera)
    np.testing.assert_array_equal(back.events, mini.events)
    np.testing.assert_array_equal(back.frames, mini.frames)


def test_the_bag_holds_the_camera(exported, mini):
    store = get_typestore(Stores.ROS1_NOETIC)
    with Reader(exported / "recording.bag") as bag:
        wanted = [c for c in bag.connections if c.topic == "/dvs/camera_info"]
        infos = [store.deserialize_ros1(raw, c.msgtype) for c, _, raw in bag.messages(wanted)]
    stamps = [i.header.stamp.sec * 10**6 + i.header.stamp.nanosec // 1000 for i in infos]
    assert stamps == mini.frames_t_us.tolist()
    assert (infos[0].width, infos[0].height) == mini.camera.size_px and infos[
        0
    ].distortion_model == "plumb_bob"
    np.testing.assert_array_equal(infos[0].K.reshape(3, 3), mini.camera.K)
    np.testing.assert_array_equal(infos[0].P.reshape(3, 4)[:, :3], mini.camera.K)


def test_camera_and_truth_are_exported(exported, mini):
    assert Camera.load(exported / "camera.json") == mini.camera
    truth = read_trajectory(exported / "truth.tum")
    np.testing.assert_array_equal(truth.t_us, mini.truth.t_us)
    np.testing.assert_allclose(truth.poses.position_m, mini.truth.poses.position_m, atol=1e-9)


def test_an_event_frame_keeps_the_count_of_events_and_no_polarity(mini):
    few = mini.events[:2000].copy()
    image = odometry_files.event_frame(few, mini.camera.size_px)
    flipped = few.copy()
    flipped["p"] = ~few["p"]
    np.testing.assert_array_equal(image, odometry_files.event_frame(flipped, mini.camera.size_px))
    counts = histogram(few["x"], few["y"], mini.camera.size_px)
    assert image.sum() * odometry_files.FULL_SCALE / 255 == pytest.approx(counts.sum(), rel=0.3)


def test_a_recording_without_events_or_frames_exports_what_it_has(tmp_path, mini):
    still = Recording("a", mini.camera, mini.events[:0], mini.frames[:3], mini.frames_t_us[:3])
    assert odometry_files.export(still, tmp_path / "a", bag=False) == {"rgb": 3, "event": 0}
    assert not (tmp_path / "a" / "truth.tum").exists()


def test_export_to_a_place_that_cannot_be_written(tmp_path, mini):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot write"):
        odometry_files.export(mini, tmp_path / "file" / "below", bag=False)


def test_an_export_replaces_nothing_that_it_reads(tmp_path, exported, capsys):
    folder = shutil.copytree(exported, tmp_path / "a")
    before = snapshot(folder)
    for source, extra in (
        (folder / "recording.bag", ()),
        (folder / "rgb", ("--fps", "20", "--camera", folder / "camera.json")),
        (MINI, ("--camera", folder / "camera.json")),
    ):
        argv = ("odometry", "export", source, folder, "--overwrite", *extra)
        assert main.main([str(a) for a in argv]) == 1
        err = capsys.readouterr().err
        assert "which is read" in err and len(err.splitlines()) == 1
    assert snapshot(folder) == before


def test_a_link_to_itself_is_one_line(tmp_path, capsys):
    loop = tmp_path / "loop.bag"
    loop.symlink_to(loop)
    for argv in (("odometry", "export", loop, tmp_path / "out"), ("estimate", loop, "-o", tmp_path / "p.csv"),
                 ("calibrate", loop, "-o", tmp_path / "rig.json")):  # fmt: skip
        more = ("--modality", "rgb") if argv[0] == "estimate" else ()
        assert main.main([str(a) for a in (*argv, *more)]) == 1
        err = capsys.readouterr().err
        assert "loop.bag" in err and len(err.splitlines()) == 1


@pytest.mark.parametrize("limit", [30_000, 300_000])
def test_a_full_disk_leaves_an_old_export_whole(tmp_path, exported, mini, limit):
    """A limit on the size of files stands for the disk: of an image, or of the bag."""
    folder = shutil.copytree(exported, tmp_path / "a")
    before, hard = snapshot(tmp_path), resource.getrlimit(resource.RLIMIT_FSIZE)[1]
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    try:
        with pytest.raises(InputError, match="cannot write"):
            odometry_files.export(mini, folder)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
    assert snapshot(tmp_path) == before


@pytest.fixture
def reference(tmp_path):
    path = tmp_path / "truth.tum"
    write_trajectory(track(400), path, "tum")
    return path


def score(capsys, *argv):
    code = main.main(["odometry", "score", *map(str, argv)])
    out, err = capsys.readouterr()
    return code, out, err


def test_a_perfect_trajectory_scores_zero(reference, capsys):
    code, out, _ = score(capsys, reference, "--reference", reference, "--json")
    rows = json.loads(out)
    assert code == 0 and len(rows) == 5
    assert all(row["stretches"] > 0 and row["median_m"] < 1e-9 for row in rows)
    code, out, _ = score(capsys, reference, "--reference", reference)
    assert code == 0 and len(out.splitlines()) == 6


def test_the_reference_may_be_a_recording(tmp_path, mini, reference, capsys):
    truth = track(400)
    short = Recording("a", mini.camera, mini.events[:100], mini.frames[:2], mini.frames_t_us[:2], truth)
    write_recording(short, tmp_path / "a.h5")
    assert score(capsys, reference, "--reference", tmp_path / "a.h5")[0] == 0
    (tmp_path / "a.truth.csv").unlink()
    code, _, err = score(capsys, reference, "--reference", tmp_path / "a.h5")
    assert code == 1 and "no ground truth beside it" in err


BAD = {
    "not a trajectory": lambda lines: ["a b c", *lines],
    "not a trajectory (": lambda lines: [line[:25] for line in lines],
    "not finite": lambda lines: [*lines[:5], lines[5].split()[0] + " nan 0 0 0 0 0 1"],
    "unit length": lambda lines: [lines[0].split()[0] + " 0 0 0 0 0 0 2"],
    "increase strictly": lambda lines: lines[::-1],
    "increase strictly (": lambda lines: [lines[0], *lines],
    "holds no pose": lambda lines: [],
    "no pose; let": lambda lines: ["# track 1"],
    "outside the reference's": lambda lines: ["9" + line for line in lines],
    "too short: 39 poses": lambda lines: lines[:39],
    "too short": lambda lines: lines[:1],
}


@pytest.mark.parametrize("reason", BAD)
def test_a_bad_trajectory_gets_one_line(reason, reference, tmp_path, capsys):
    path = tmp_path / "bad.tum"
    path.write_text("\n".join(BAD[reason](reference.read_text().splitlines())))
    code, out, err = score(capsys, path, "--reference", reference)
    assert code == 1 and out == ""
    assert err.count("\n") == 1 and str(path) in err and reason.removesuffix(" (") in err


def test_files_that_are_absent_or_of_another_kind(reference, tmp_path, capsys):
    for trajectory, ref, reason in (
        (tmp_path / "none.tum", reference, "no such file"),
        (reference, tmp_path / "none.h5", "no such file"),
        (tmp_path / "a.bag", reference, "cannot read '.bag'"),
    ):
        code, _, err = score(capsys, trajectory, "--reference", ref)
        assert code == 1 and err.count("\n") == 1 and reason in err


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir])
def test_what_is_no_file_among_what_is_exported_leaves_all_files(tmp_path, exported, capsys, make):
    folder = shutil.copytree(exported, tmp_path / "a")
    (odd := folder / "rgb.txt").unlink()
    before = snapshot(folder)
    make(odd)
    assert main.main(["odometry", "export", str(MINI), str(folder), "--overwrite"]) == 1
    assert "rgb.txt: is a folder, a device or a pipe" in capsys.readouterr().err
    odd.rmdir() if odd.is_dir() else odd.unlink()
    assert snapshot(folder) == before
