"""The command line: what a user types, what it answers, and what bad input gets."""

import csv
import json
from pathlib import Path

import pytest

from lmmap import cli
from lmmap.core import Camera
from lmmap.results import DATA, ROOT

MINI = DATA / "mini" / "test-medium.aedat4"
REAL = ROOT.parent / "shared" / "recordings" / "newtons-cradle-davis346.aedat4"


def run(capsys, *argv):
    code = cli.main([str(a) for a in argv])
    out, err = capsys.readouterr()
    return code, out, err


def test_simulate_info_estimate_evaluate(tmp_path, capsys):
    demo, poses = tmp_path / "demo.aedat4", tmp_path / "poses.csv"
    code, out, _ = run(capsys, "simulate", "--sequence", "test-medium", "--seconds", "0.4", "-o", demo)
    assert code == 0 and "events" in out
    assert demo.with_suffix(".truth.csv").exists()

    code, out, _ = run(capsys, "info", demo, "--json")
    facts = json.loads(out)
    assert code == 0 and facts["frames"] == 8 and facts["truth"]

    for modality, images in (("rgb", facts["frames"]), ("event", facts["windows"])):
        code, out, _ = run(capsys, "estimate", demo, "--modality", modality, "-o", poses)
        rows = list(csv.DictReader(poses.read_text().splitlines()))
        assert code == 0 and f"{images} images" in out
        assert len(rows) == images
        assert set(rows[0]) >= {"t_us", "status", "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"}

    code, out, _ = run(capsys, "evaluate", demo)
    assert code == 0 and "paper formula normal median deg" in out
    code, out, _ = run(capsys, "evaluate", demo, "--modality", "rgb", "--json")
    assert json.loads(out)["rgb"]["images"] == 8


def test_tum_has_a_line_per_pose(tmp_path, capsys):
    poses = tmp_path / "poses.txt"
    code, out, _ = run(capsys, "estimate", MINI, "--modality", "rgb", "-o", poses, "--format", "tum")
    lines = poses.read_text().splitlines()
    assert code == 0 and f"{len(lines)} ok" in out
    assert all(len(line.split()) == 8 for line in lines)


def write_camera(folder, **changes):
    path = folder / "camera.json"
    Camera(
        **{**dict(width_px=640, height_px=480, fx_px=500, fy_px=500, cx_px=320, cy_px=240), **changes}
    ).save(path)
    return path


def bad_inputs(folder: Path):
    text = folder / "text.aedat4"
    text.write_text("time,x,y\n1,2,3\n")
    empty = folder / "empty.aedat4"
    empty.touch()
    cut = folder / "cut.aedat4"
    cut.write_bytes(MINI.read_bytes()[: MINI.stat().st_size // 2])
    nonsense = folder / "nonsense.yaml"
    nonsense.write_text("a: [1, 2")
    broken_port = folder / "port.json"
    broken_port.write_text('{"ring_radius_m": 1}')
    out = folder / "x.csv"
    estimate = ("--modality", "rgb", "-o", out)
    yield ("estimate", folder / "absent.aedat4", *estimate), "absent.aedat4"
    yield ("estimate", folder, *estimate), str(folder)
    yield ("estimate", text, *estimate), "text.aedat4"
    yield ("info", text), "text.aedat4"
    yield ("info", empty), "empty.aedat4"
    yield ("estimate", cut, *estimate), "cut.aedat4"
    yield ("info", cut), "cut.aedat4"
    yield ("estimate", MINI, *estimate, "--camera", write_camera(folder)), "640 x 480"
    yield ("estimate", MINI, *estimate, "--camera", nonsense), "nonsense.yaml"
    yield ("estimate", MINI, *estimate, "--port", broken_port), "port.json"
    yield ("estimate", MINI, *estimate, "--rate", "-3"), "--rate"
    yield ("estimate", MINI, "--modality", "rgb", "-o", folder / "no" / "x.csv"), "x.csv"
    yield ("simulate", "--sequence", "test-dim", "-o", folder / "a.aedat4"), "test-dim"
    yield ("simulate", "--sequence", "test-low", "--seconds", "-1", "-o", folder / "a.aedat4"), "-1"
    yield ("simulate", "--sequence", "test-low", "-o", folder / "a.mp4"), "a.mp4"
    yield ("simulate", "--sequence", "test-low", "-o", folder / "no" / "a.npz"), "no"


def test_bad_input_is_one_clear_line(tmp_path, capsys):
    before = None
    for argv, named in bad_inputs(tmp_path):
        code, out, err = run(capsys, *argv)
        assert code == 1, argv
        assert len(err.strip().splitlines()) == 1 and err.startswith("lmmap: "), err
        assert named in err
        assert out == ""
        assert not (tmp_path / "x.csv").exists() and not (tmp_path / "a.aedat4").exists()
        before = argv
    assert before is not None


def test_evaluate_needs_truth(tmp_path, capsys):
    bare = tmp_path / "bare.aedat4"
    bare.write_bytes(MINI.read_bytes())
    code, _, err = run(capsys, "evaluate", bare)
    assert code == 1 and "no ground truth" in err


def test_usage_errors_exit_with_2(capsys):
    for argv in ([], ["estimate"], ["estimate", "a", "--modality", "lidar", "-o", "b"], ["dance"]):
        with pytest.raises(SystemExit) as stop:
            cli.main(argv)
        assert stop.value.code == 2
    capsys.readouterr()


@pytest.mark.skipif(not REAL.exists(), reason="the real DAVIS 346 recording is not beside the checkout")
def test_real_recording_without_a_port(tmp_path, capsys):
    code, out, _ = run(capsys, "info", REAL, "--json")
    facts = json.loads(out)
    assert (code, facts["events"], facts["frames"]) == (0, 319_512, 13)
    assert facts["duration_s"] == pytest.approx(0.51, abs=0.005)
    for modality, images in (("rgb", 13), ("event", 9)):
        poses = tmp_path / f"{modality}.csv"
        assert run(capsys, "estimate", REAL, "--modality", modality, "-o", poses)[0] == 0
        rows = list(csv.DictReader(poses.read_text().splitlines()))
        assert len(rows) == images
        assert all(row["status"] != "ok" for row in rows)
