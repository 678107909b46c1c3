"""The authors' bags, by stand-ins: names, health, calibration and evaluation on the command line."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from test_rig import line, write_arm

from lmmap import open_recording
from lmmap.cli import main
from lmmap.files import CAMERA
from lmmap.pipeline.estimator import Estimator
from lmmap.recordings.formats import open_stream
from lmmap.types import Camera, InputError, Trajectory
from lmmap_lab.bench import sequences
from lmmap_lab.bench.writers import write_recording
from lmmap_lab.provenance import DATA
from lmmap_lab.rig import authors_bags, calibration, checkerboard, standin
from lmmap_lab.rig.truth import true_trajectory
from lmmap_readers.rig import RIG_FILE, Rig

MINI = DATA / "mini" / "test-low.aedat4"


def brief(seconds: float = 0.4):
    """The first images of the committed recording, from time zero."""
    whole = open_recording(MINI)
    whole = standin.shift_time(whole, -int(whole.truth.t_us[0]))
    end_us = int(seconds * 1e6)
    truth, frames = whole.truth, whole.frames_t_us < end_us
    kept = truth.t_us <= end_us + 100_000
    return replace(whole, events=whole.events[whole.events["t_us"] < end_us], frames=whole.frames[frames],
                   frames_t_us=whole.frames_t_us[frames],
                   truth=Trajectory(truth.t_us[kept], truth.poses[kept]))  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A set of one test bag with its hand-eye file and camera."""
    root = tmp_path_factory.mktemp("set")
    (root / "dataset_0307_notexture").mkdir()
    standin.write_bag(brief(), root / "dataset_0307_notexture" / "dark__test.bag")
    standin.write_hand_eye(root / authors_bags.HAND_EYE)
    Camera.davis346().save(root / CAMERA)
    return root


def run(capsys, *argv):
    code = main.main([str(a) for a in argv])
    out, err = capsys.readouterr()
    return code, out, err


@pytest.mark.parametrize("name, role, light, textured", [
    ("dataset_0307/T1_RA_0_ES_0_cover.bag", "train", "low", True),
    ("dataset_0307/T2_RA_0_ES_1_cover.bag", "train", "medium", True),
    ("dataset_0307_notexture/T3_RA_75_ES_0_x.bag", "train", "high", False),
    ("test_datasets_additional/T3_RA_75_ES_1_x.bag", "test", "high", False),
    ("dataset_0307_notexture/normal__train.bag", "train", "medium", False),
    ("anywhere/dark__test.bag", "test", "low", False),
    ("hard_cases_benchmark/mixed__hard.bag", "hard", "mixed", False),
    ("hard_cases_additional/T1_RA_9_ES_0_light.bag", "hard", "high", False),
    ("dataset_0307/T1_RA_0_ES_1_noport.bag", "empty", "medium", False),
    ("dataset_0307/dvs_calibration.bag", "calibration", None, False),
])  # fmt: skip
def test_a_name_says_role_and_light(name, role, light, textured):
    bag = authors_bags.describe_bag(name)
    assert (bag.role, bag.light, bag.textured) == (role, light, textured)


def test_every_stand_in_has_a_name_as_the_authors_give():
    bags = [authors_bags.describe_bag(name) for name, _ in standin.STAND_INS]
    assert {b.role for b in bags} == {"train", "test", "hard", "empty"}
    lights = {b.light for b in bags if b.role == "test"}
    assert lights == {"low", "medium", "high"}
    assert "its name says neither" in line(authors_bags.describe_bag, Path("holiday.bag"))


def test_the_truth_of_a_stand_in_is_the_benchs(folder):
    bag, recording = folder / "dataset_0307_notexture" / "dark__test.bag", brief()
    stream = open_stream(bag)
    truth = true_trajectory(bag, standin.RIG).at(recording.truth.t_us + standin.START_US)
    np.testing.assert_allclose(truth.position_m, recording.truth.poses.position_m, atol=1e-9)
    np.testing.assert_allclose(truth.rotation, recording.truth.poses.rotation, atol=1e-9)
    again = stream.collect()
    assert np.array_equal(again.frames, recording.frames) and len(again.events) == len(recording.events)
    assert set(authors_bags.bag_contents(bag)["topics"]) == {
        authors_bags.EVENTS, authors_bags.FRAMES, authors_bags.TF, authors_bags.STATES
    }  # fmt: skip


def test_evaluating_a_bag_equals_evaluating_the_sequence(folder, tmp_path, capsys):
    bag, rig = folder / "dataset_0307_notexture" / "dark__test.bag", folder / RIG_FILE
    code, _, err = run(capsys, "evaluate", bag, "--modality", "rgb")
    assert code == 1 and "lmmap calibrate" in err
    standin.RIG.save(rig)
    write_recording(standin.shift_time(brief(), standin.START_US), tmp_path / "direct.h5")
    numbers = []
    for path in (bag, tmp_path / "direct.h5"):
        code, out, _ = run(capsys, "evaluate", path, "--json")
        assert code == 0
        report = json.loads(out)
        numbers.append([v for m in ("rgb", "event") for k, v in report[m].items() if k != "table"])
    rig.unlink()
    np.testing.assert_allclose(*numbers, rtol=1e-6)
    assert numbers[0][0] == len(brief().frames)


def test_calibrating_a_bag(folder, capsys, monkeypatch):
    """Two seconds of frames, with the camera from the file: the port to some mm; detections are kept."""
    bag, rig = folder / "dataset_0307_notexture" / "normal__train.bag", folder / RIG_FILE
    with monkeypatch.context() as patch:  # no events
        patch.setattr(sequences, "render_times_us", lambda *_: np.zeros(1, np.int64))
        standin.write_bag(sequences.simulate("test-low", 2.0), bag)
    argv = ("calibrate", bag, "-o", rig, "--rate")
    code, _, err = run(capsys, *argv, "2")
    assert code == 1 and "detections while the arm reports, 20 are needed" in err and err.count("\n") == 1
    code, out, err = run(capsys, *argv, "12")
    assert code == 0 and "from the hand-eye file" in out and not err
    calibrated, wanted = Rig.load(rig), standin.RIG
    assert np.linalg.norm(calibrated.T_tip_port.position_m - wanted.T_tip_port.position_m) < 0.005
    assert 0 < calibrated.calibration["port_sigma_mm"] < 3
    assert calibrated.ring_radius_m == pytest.approx(wanted.ring_radius_m, rel=0.02)
    assert calibrated.calibration["recordings"] == ["normal__train.bag"]
    for bad in (("-o", folder / "nowhere" / "rig.json", "--rate", "12"), ("-o", rig, "--rate", "0")):
        code, _, err = run(capsys, "calibrate", bag, *bad)
        assert code == 1 and err.count("\n") == 1
    monkeypatch.setattr(Estimator, "__call__", None)  # nothing is estimated twice
    monkeypatch.setattr(calibration, "calibrate_rig", lambda *_: calibrated)
    code, out, _ = run(capsys, *argv, "12", "--json", "--overwrite")
    assert code == 0 and json.loads(out)["root"] == "base_link"
    code, _, err = run(capsys, *argv, "12", "--hand-eye", folder / CAMERA, "--overwrite")
    assert code == 1 and "no hand-eye calibration" in err and "width_px" in err
    for path in (rig, bag):
        path.unlink()


def test_a_bag_without_one_camera_is_reported(folder, tmp_path, capsys):
    """What a bag lacks is a note where the other camera answers, and one line where none does."""
    for name in (authors_bags.HAND_EYE, CAMERA):
        shutil.copy(folder / name, tmp_path)
    standin.RIG.save(tmp_path / RIG_FILE)
    bag, whole = tmp_path / "dark__test.bag", brief(0.2)
    standin.write_bag(replace(whole, events=whole.events[:0]), bag)
    code, out, err = run(capsys, "evaluate", bag)
    assert code == 0 and "rgb" in out and "event" not in out
    assert "note: " in err and "holds no event data" in err and err.count("\n") == 1
    code, _, err = run(capsys, "calibrate", bag, "--modality", "event", "-o", tmp_path / "again.json")
    assert code == 1 and "holds no images for --modality event" in err and err.count("\n") == 1


def test_stand_ins_are_written_once(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(standin, "STAND_INS", standin.STAND_INS[4:5])
    argv = ("simulate", "--as-published", tmp_path / "set", "--seconds", "0.2")
    code, out, err = run(capsys, *argv)
    bag = tmp_path / "set" / "dataset_0307_notexture" / "dark__test.bag"
    assert code == 0 and f"{bag}: test-low" in out, err
    direct, stood_in = sequences.simulate("test-low", 0.2), open_stream(bag, Camera.davis346()).collect()
    assert np.array_equal(direct.frames, stood_in.frames)
    assert np.array_equal(direct.events["x"], stood_in.events["x"])
    before = bag.stat().st_mtime_ns
    assert run(capsys, *argv)[0] == 0 and bag.stat().st_mtime_ns == before
    assert not list(tmp_path.rglob("*.parts"))
    for bad in (("--as-published", bag), ("--as-published", tmp_path, "--seconds", "90"), ()):
        code, _, err = run(capsys, "simulate", *bad)
        assert code == 1 and err.count("\n") == 1


def test_check_lists_what_is_usable(folder, tmp_path, capsys):
    code, out, _ = run(capsys, "dataset")
    assert code == 0 and "2123/33938" in out and "over 6 GB" in out
    bag = folder / "dataset_0307_notexture" / "dark__test.bag"
    other = tmp_path / "hard_cases_benchmark"
    other.mkdir()
    (other / "dark__hard.bag").write_bytes(bag.read_bytes()[:1_000_000])
    (other / "holiday.bag").write_bytes(bag.read_bytes())
    write_arm(other / "light__hard.bag")
    (other / "normal__test.bag").write_bytes(bag.read_bytes())
    standin.write_hand_eye(tmp_path / authors_bags.HAND_EYE)
    written = (tmp_path / authors_bags.HAND_EYE).stat()
    standin.write_hand_eye(tmp_path / authors_bags.HAND_EYE)
    assert (tmp_path / authors_bags.HAND_EYE).stat() == written  # what is there already is not written anew
    code, out, _ = run(capsys, "dataset", "check", tmp_path, "--json")
    problems = {Path(row["bag"]).stem: row["problem"] for row in json.loads(out)}
    assert code == 0 and problems["normal__test"] == ""
    assert "cannot read this bag" in problems["dark__hard"]
    assert "neither light nor purpose" in problems["holiday"]
    assert "no messages of /dvs/events, /dvs/image_raw" in problems["light__hard"]
    assert all("\n" not in p for p in problems.values())
    code, out, _ = run(capsys, "dataset", "check", tmp_path)
    assert code == 0 and "1 of 4 bags usable: 1 test" in out
    for bad in (("check", tmp_path / "nowhere"), ("check",)):
        code, _, err = run(capsys, "dataset", *bad)
        assert code == 1 and err.count("\n") == 1
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / "a.tar").touch()
    with pytest.raises(InputError, match="unpack"):
        authors_bags.list_bags(tmp_path / "empty")


def test_intrinsics_from_a_board(tmp_path, capsys):
    camera = Camera(346, 260, 330.0, 328.0, 170.0, 131.0, (-0.3, 0.1, 0.001, -0.0008))
    recording = standin.simulate_checkerboard(camera, views=12)
    calibrated, facts = checkerboard.calibrate_intrinsics(recording.timed_frames(), (8, 5), 0.03)
    assert facts["rms_px"] < 0.15 and facts["views"] >= 8
    wanted = np.array([camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px])
    values = np.array([calibrated.fx_px, calibrated.fy_px, calibrated.cx_px, calibrated.cy_px])
    assert np.all(np.abs(values - wanted) < 4 * np.array(facts["sigma_px"]))
    assert np.all(np.abs(values[:2] / wanted[:2] - 1) < 0.005)
    np.testing.assert_allclose(calibrated.distortion[:2], camera.distortion[:2], atol=0.03)
    standin.write_bag(recording, tmp_path / "dvs_calibration.bag")
    code, out, _ = run(capsys, "calibrate", tmp_path / "dvs_calibration.bag", "--board", "8x5")
    assert code == 0 and "px left" in out
    assert Camera.load(tmp_path / CAMERA).fx_px == pytest.approx(calibrated.fx_px)
    code, _, err = run(capsys, "calibrate", tmp_path / "dvs_calibration.bag", "--board", "big")
    assert code == 1 and "inner corners" in err and err.count("\n") == 1
    with pytest.raises(ValueError, match="7 x 7 inner corners is seen in 0 views"):
        checkerboard.calibrate_intrinsics([(0, recording.frames[0])], (7, 7), 0.03)


def views_of_a_board(tilt_rad, views=12, noise_px=0.05, seed=0):
    """Corners of a board of 8 x 5, seen by a camera of 640 x 480 px, in place of a search for them."""
    K, rng = np.array([[520.0, 0, 322], [0, 518, 244], [0, 0, 1]]), np.random.default_rng(seed)
    board = np.zeros((40, 3))
    board[:, :2] = 0.03 * (np.mgrid[:8, :5].T.reshape(-1, 2) - [3.5, 2])
    found = []
    for _ in range(views):
        turn = np.array([*rng.uniform(-1, 1, 2) * tilt_rad, rng.normal(0, 0.3)])
        place = np.array([*rng.uniform(-0.06, 0.06, 2), rng.uniform(0.4, 0.7)])
        points = cv2.projectPoints(board, turn, place, K, None)[0].reshape(-1, 2)
        found.append((points + rng.normal(0, noise_px, points.shape)).astype(np.float32))
    return found


def calibrated(monkeypatch, found):
    monkeypatch.setattr(checkerboard, "find_corners_px", lambda frame, corners: found[frame[0, 0]])
    frames = ((k * 10**6, np.broadcast_to(k, (480, 640))) for k in range(len(found)))
    return checkerboard.calibrate_intrinsics(frames, (8, 5), 0.03)


@pytest.mark.parametrize("tilt_rad", [0.0, 0.0175])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_board_that_was_never_tilted_tells_no_focal_length(monkeypatch, tilt_rad, seed):
    with pytest.raises(ValueError, match=r"is known to \d+ px only.*tilt it"):
        calibrated(monkeypatch, views_of_a_board(tilt_rad, seed=seed))


@pytest.mark.parametrize("tilt_rad", [0.06, 0.2, 0.5])
def test_a_focal_length_is_as_far_off_as_it_says(monkeypatch, tilt_rad):
    """By the errors' mean square in standard deviations, which is 1, over twelve boards."""
    off = []
    for seed in range(12):
        camera, facts = calibrated(monkeypatch, views_of_a_board(tilt_rad, seed=seed))
        off.append((camera.fx_px - 520) / facts["sigma_px"][0])
    assert 0.2 < np.mean(np.square(off)) < 2.5


def test_a_board_that_stands_still_is_one_view(monkeypatch):
    found = views_of_a_board(0.5, 3)
    still = [view + np.float32(0.1 * k) for view in found for k in range(10)]
    with pytest.raises(ValueError, match="is seen in 3 views that differ, and 8 are needed"):
        calibrated(monkeypatch, still)


def test_the_first_calibration_of_a_sensor(tmp_path, capsys):
    """Of pictures without times, and without a camera from before; written where it is read."""
    camera = Camera(320, 240, 300.0, 301.0, 161.0, 119.0)
    recording = standin.simulate_checkerboard(camera, views=20)
    (tmp_path / "board").mkdir()
    for k, frame in enumerate(recording.frames):
        cv2.imwrite(str(tmp_path / "board" / f"{k}.png"), frame)
    command = "calibrate", tmp_path / "board", "--board", "8x5", "-o", tmp_path / "c.yaml"
    code, out, err = run(capsys, *command)
    assert code == 0 and " views, " in out and not err
    assert Camera.load(tmp_path / "c.yaml").fx_px == pytest.approx(300, rel=0.01)
    code, _, err = run(capsys, *command, "--overwrite", "--free")
    assert code == 1 and "calibrates a camera, no rig; leave --free out" in err
