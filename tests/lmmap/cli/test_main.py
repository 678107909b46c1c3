"""The command line: what a user types, what it answers, and what bad input gets."""

import csv
import functools
import importlib
import io
import itertools
import json
import os
import re
import subprocess
import sys
import time
from itertools import pairwise

import cv2
import drawn
import numpy as np
import pytest
import shtab
from test_bad_input import write_camera

from lmmap import settings
from lmmap.cli import arguments, choices, main, progress
from lmmap.cli.commands import OWN
from lmmap.estimation import images as recorded
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.image_estimator import settings_for
from lmmap.pipeline.network import CHANNELS
from lmmap.pipeline.weights import FORMER, SETS
from lmmap.recordings import devices
from lmmap.recordings.formats import UNITS, open_recording
from lmmap.recordings.journal import Journal
from lmmap.recordings.pose_files import read_estimates
from lmmap.settings import OURS
from lmmap.shipped import ROOT
from lmmap.types import Camera, Estimate, Status

DRAWN = drawn.file(6)
SLOW = drawn.file(6, 250_000)  # of 1.25 s
REAL = ROOT.parent / "shared" / "recordings" / "newtons-cradle-davis346.aedat4"


def run(capsys, *argv):
    code = main.main([str(a) for a in argv])
    out, err = capsys.readouterr()
    return code, out, err


def test_info_estimate_evaluate(tmp_path, capsys):
    poses, facts = tmp_path / "poses.csv", json.loads(run(capsys, "info", DRAWN, "--json")[1])
    assert (facts["frames"], facts["windows"]) == (6, 5) and facts["truth"]
    for modality, images in (("rgb", facts["frames"]), ("event", facts["windows"])):
        code, out, _ = run(capsys, "estimate", DRAWN, "--modality", modality, "-o", poses, "--overwrite")
        rows = list(csv.DictReader(poses.read_text().splitlines()))
        assert code == 0 and f"{images} images" in out and len(rows) == images
        assert set(rows[0]) >= {"t_us", "status", "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"}

    code, out, _ = run(capsys, "evaluate", DRAWN, "--rate", "10")
    assert code == 0 and "paper formula normal median deg" in out
    assert "with outlier filter: position error median mm" in out
    lines = out.splitlines()
    assert len({len(line) for line in lines}) == 1 and re.fullmatch(r"images( +\d+){3}", lines[1])


def test_tum_has_a_line_per_pose(tmp_path, capsys):
    poses = tmp_path / "poses.txt"
    code, out, _ = run(capsys, "estimate", DRAWN, "--modality", "rgb", "-o", poses, "--format", "tum")
    lines = poses.read_text().splitlines()
    assert code == 0 and f"{len(lines)} ok" in out
    assert all(len(line.split()) == 8 for line in lines)


def test_evaluate_needs_truth(tmp_path, capsys):
    bare = tmp_path / "bare.aedat4"
    bare.write_bytes(DRAWN.read_bytes())
    code, _, err = run(capsys, "evaluate", bare)
    assert code == 1 and "no ground truth" in err
    truth = DRAWN.with_suffix(".truth.csv")
    code, out, _ = run(capsys, "evaluate", bare, "--truth", truth, "--modality", "rgb", "--rate", 5, "--json")
    beside = run(capsys, "evaluate", DRAWN, "--modality", "rgb", "--rate", "5", "--json")[1]
    assert code == 0 and json.loads(out) == json.loads(beside)
    table = json.loads(out)["rgb"]["table"]
    assert table["without/position_error_m/exact/rmse"] >= table["without/position_error_m/exact/median"] / 2


def test_resuming_equals_an_unbroken_run(tmp_path, capsys, monkeypatch):
    """Interrupted after 2 images, then killed within a line: the file ends equal byte by byte."""
    for form in ("csv", "tum"):
        whole, cut = tmp_path / f"whole.{form}", tmp_path / f"cut.{form}"
        argv = ("estimate", DRAWN, "--modality", "rgb", "--rate", "10", "--format", form, "-o")
        assert run(capsys, *argv, whole)[0] == 0
        add, calls = Journal.add, []

        def interrupted(self, estimate, add=add, calls=calls):
            calls.append(add(self, estimate))
            if len(calls) == 2:
                raise KeyboardInterrupt

        monkeypatch.setattr(Journal, "add", interrupted)
        code, _, err = run(capsys, *argv, cut)
        assert code == 130 and "--resume continues" in err and "Traceback" not in err
        monkeypatch.undo()
        kept = cut.read_bytes()
        assert whole.read_bytes().startswith(kept) and kept.count(b"\n") in (2, 3)
        cut.write_bytes(kept + b"16000000")
        code = run(capsys, *argv, cut, "--resume", "--json")[0]
        assert code == 0 and cut.read_bytes() == whole.read_bytes()
        assert run(capsys, *argv, cut, "--resume")[0] == 0 and cut.read_bytes() == whole.read_bytes()


def test_what_was_looked_at_twice_is_gone_on_with_too(tmp_path, capsys, monkeypatch):
    """With an estimator that fails on every other histogram of N events, and not on wider ones."""
    estimated, shots = Estimator.on_grid, recorded.images(open_recording(DRAWN), "event", rate_hz=20)
    first_us = [t_us for t_us, _ in shots]

    def seldom(self, image, t_us=0, near=None):
        if image.sum() > self.settings.events_per_window or t_us not in first_us[1::2]:
            return estimated(self, image, t_us, near)
        return Estimate(t_us, Status.NO_RING)

    monkeypatch.setattr(Estimator, "on_grid", seldom)
    argv = ("estimate", DRAWN, "--modality", "event", "--rate", "20", "-o")
    whole, cut = tmp_path / "whole.csv", tmp_path / "cut.csv"
    assert run(capsys, *argv, whole)[0] == 0
    every = read_estimates(whole)
    wider = [k for k, e in enumerate(every) if e.t_us not in first_us]
    assert len(wider) > 1 and all(every[k].status == Status.OK for k in wider)
    assert all(a.t_us < b.t_us for a, b in pairwise(every))
    lines = whole.read_text().splitlines(keepends=True)
    for count in (wider[0] + 1, wider[0] + 2):  # the last line of a second look, or the one after it
        cut.write_text("".join(lines[: count + 1]))
        (tmp_path / "cut.csv.made-of").write_bytes((tmp_path / "whole.csv.made-of").read_bytes())
        assert run(capsys, *argv, cut, "--resume")[0] == 0
        assert cut.read_text() == whole.read_text()


def test_resuming_with_other_images_is_refused(tmp_path, capsys):
    poses = tmp_path / "poses.csv"
    argv = ("estimate", DRAWN, "--modality", "rgb", "-o", poses)
    assert run(capsys, *argv, "--rate", "5")[0] == 0
    before = poses.read_bytes()
    code, _, err = run(capsys, *argv, "--resume")
    assert code == 1 and "was made with another rate" in err and len(err.splitlines()) == 1
    assert poses.read_bytes() == before


def test_fused_poses_and_what_was_fused(tmp_path, capsys, monkeypatch):
    """Both cameras' tables lie beside the fused one; interrupted, it ends equal byte by byte."""
    whole, cut = tmp_path / "whole.csv", tmp_path / "cut.csv"
    argv = ("estimate", DRAWN, "--modality", "fused", "--rate", "10", "-o")
    assert run(capsys, *argv, whole)[0] == 0
    fused, rgb, event = (read_estimates(whole.with_suffix(s)) for s in (".csv", ".rgb.csv", ".event.csv"))
    assert [e.t_us for e in fused] == [e.t_us for e in rgb]
    assert len(event) == 2 and all(e.T_cam_port is not None and e.covariance is not None for e in fused)

    add, calls = Journal.add, []

    def interrupted(self, estimate):
        calls.append(add(self, estimate))
        if len(calls) == 5:
            raise KeyboardInterrupt

    monkeypatch.setattr(Journal, "add", interrupted)
    assert run(capsys, *argv, cut)[0] == 130
    monkeypatch.undo()
    kept = cut.with_suffix(".rgb.csv").read_bytes()
    assert 0 < len(cut.read_bytes()) < len(whole.read_bytes())
    monkeypatch.setattr(Journal, "add", interrupted)
    calls.clear()
    before = {path: path.read_bytes() for path in sorted(tmp_path.glob("whole*"))}
    code, _, err = run(capsys, *argv, whole, "--overwrite")
    assert code == 130 and f"{whole}.lmmap-part keeps what was estimated, --resume continues" in err
    monkeypatch.undo()
    assert {path: path.read_bytes() for path in before} == before
    assert run(capsys, *argv, whole, "--resume")[0] == 0
    assert {path: path.read_bytes() for path in sorted(tmp_path.glob("whole*"))} == before
    cut.with_suffix(".rgb.csv").write_bytes(kept + b"16000000")
    assert run(capsys, *argv, cut, "--resume")[0] == 0
    for suffix in (".csv", ".rgb.csv", ".event.csv"):
        assert cut.with_suffix(suffix).read_bytes() == whole.with_suffix(suffix).read_bytes()
    code, _, err = run(capsys, *argv, cut, "--video", tmp_path / "o.mp4")
    assert code == 1 and "one camera's images" in err


def test_a_track_of_both_cameras_is_one_file_in_the_order_of_time(tmp_path, capsys):
    argv = ("estimate", DRAWN, "--modality", "fused", "--rate", "20", "--track", "-o", tmp_path / "p.csv")
    assert run(capsys, *argv)[0] == 0
    answers = read_estimates(tmp_path / "p.csv")
    assert [path.name for path in tmp_path.glob("*.csv")] == ["p.csv"] and len(answers) == 6 + 4
    assert [e.t_us for e in answers] == sorted(e.t_us for e in answers)
    assert all(e.status == "ok" and e.covariance is not None for e in answers)
    code, _, err = run(capsys, *argv, "--resume")
    assert code == 1 and "a track cannot be resumed" in err


def test_events_between_images_add_poses_and_leave_the_images_statuses(tmp_path, capsys):
    argv = ("estimate", DRAWN, "--modality", "event", "--rate", "10", "--track", "--json", "-o")
    alone = json.loads(run(capsys, *argv, tmp_path / "a.csv")[1])
    both = json.loads(run(capsys, *argv, tmp_path / "b.csv", "--between", "100")[1])
    assert (both["images"], both["statuses"]) == (alone["images"], alone["statuses"])
    images, answers = read_estimates(tmp_path / "a.csv"), read_estimates(tmp_path / "b.csv")
    assert len(answers) == both["images"] + both["between"] > 5 * len(images)
    assert [e.t_us for e in answers] == sorted(e.t_us for e in answers)
    times_us = {e.t_us for e in images}
    ticks = [e for e in answers if e.t_us not in times_us]
    assert {e.status for e in ticks} == {"predicted"}
    assert all((e.t_us - images[0].t_us) % 10_000 == 0 and e.covariance is not None for e in ticks)


@pytest.mark.parametrize(
    ("extra", "said"),
    [
        (("--modality", "event"), "give --track"),
        (("--modality", "event", "--track", "--format", "tum"), "cannot mark"),
        (("--modality", "rgb", "--track"), "than rgb"),
    ],
)
def test_poses_between_images_need_a_track_by_events(tmp_path, capsys, extra, said):
    argv = ("estimate", DRAWN, "--between", "100", "-o", tmp_path / "p.csv", *extra)
    code, _, err = run(capsys, *argv)
    assert code == 1 and said in err and not list(tmp_path.iterdir())


def test_evaluate_has_all_three(capsys):
    code, out, _ = run(capsys, "evaluate", DRAWN, "--rate", "10", "--json")
    report = json.loads(out)
    assert code == 0 and list(report) == ["rgb", "event", "fused"]
    assert report["fused"]["detected_of_all_percent"] >= report["event"]["detected_of_all_percent"]
    assert report["fused"]["paper_formula_position_median_mm"] is None
    only = json.loads(run(capsys, "evaluate", DRAWN, "--rate", "10", "--modality", "fused", "--json")[1])
    assert only == {"fused": report["fused"]}


def test_as_printed_is_the_paper_s_procedure(capsys):
    """Its normals err by the formula's bias; it knows no fusion."""
    argv = ("evaluate", DRAWN, "--rate", "5", "--as-printed", "--json", "--modality")
    report = json.loads(run(capsys, *argv, "rgb")[1])["rgb"]
    assert report["normal_error_median_deg"] > 2 and report["position_error_median_mm"] < 20
    assert report["paper_formula_normal_median_deg"] is None
    code, _, err = run(capsys, *argv, "fused")
    assert code == 1 and "the paper fuses nothing" in err


def test_overlay_has_a_picture_an_image(tmp_path, capsys):
    video = tmp_path / "o.mp4"
    argv = ("estimate", DRAWN, "--modality", "event", "--rate", "20", "-o", tmp_path / "p.csv", "--json")
    code, out, _ = run(capsys, *argv, "--video", video)
    film, pictures = cv2.VideoCapture(str(video)), 0
    while film.read()[0]:
        pictures += 1
    assert code == 0 and pictures == json.loads(out)["images"] == 4
    for other in (video, tmp_path / "rest.mp4"):  # which would hold what is left alone
        code, _, err = run(capsys, *argv, "--video", other, "--resume")
        assert code == 1 and other.name in err


def test_live_plays_a_recording_in_its_own_time(tmp_path, capsys):
    began = time.monotonic()
    poses = tmp_path / "p.csv"
    code, out, err = run(capsys, "live", SLOW, "--modality", "rgb", "--json", "-o", poses)
    took_s = time.monotonic() - began
    lines = [json.loads(line) for line in out.splitlines()]
    assert code == 0 and took_s > 1.25
    assert [e.t_us for e in read_estimates(poses)] == [line["t_us"] for line in lines]
    skipped = int(re.search(r"(\d+) skipped", err)[1])
    assert len(lines) + skipped == 6 and "ms late" in err
    assert any(line["status"] == "ok" and len(line["position_m"]) == 3 for line in lines)
    assert all(line["late_ms"] >= 0 for line in lines)
    code, out, err = run(capsys, "live", SLOW, "--modality", "event", "--seconds", "1")
    assert code == 0 and " ms late" in out and "\033" not in out + err


def test_live_tells_poses_between_histograms(tmp_path, capsys, monkeypatch):
    """Each answer is of the newest events; an image's also says what it shows alone.  Time goes on by the
    device's calls, not by the machine's load."""
    ticks = itertools.count()
    clock = functools.partial(devices.Played, clock=lambda: 0.001 * next(ticks))
    monkeypatch.setattr(devices, "Played", clock)
    argv = ("live", SLOW, "--modality", "event", "--between", "100", "--json", "-o", tmp_path / "p.csv")
    code, out, err = run(capsys, *argv)
    lines = [json.loads(line) for line in out.splitlines()]
    images, between = ([line for line in lines if ("measured" in line) == image] for image in (True, False))
    assert code == 0 and f"{len(images)} images" in err and " skipped" in err
    assert len(between) > 0 and {line["status"] for line in between} == {"predicted"}
    times_us = [line["t_us"] for line in between]
    assert np.all(np.diff(times_us) >= 10_000)
    assert all({"predicted", "confidence", "late_ms"} <= line.keys() for line in images[1:])
    assert [e.t_us for e in read_estimates(tmp_path / "p.csv")] == [line["t_us"] for line in lines]


def test_live_without_a_camera(capsys):
    code, _, err = run(capsys, "live", "--modality", "rgb")
    assert code == 1 and "--camera" in err
    code, _, err = run(capsys, "live", "--modality", "rgb", "--camera", DRAWN.with_suffix(".camera.json"))
    assert code == 1 and "no camera found" in err


def test_window_scales_with_the_sensor_unless_given():
    camera = Camera(640, 480, 500, 500, 320, 240)
    assert settings_for(camera).events_per_window == round(35_000 * 640 * 480 / (346 * 260))
    assert settings_for(camera, 1234).events_per_window == 1234
    assert settings_for(Camera.davis346()) == OURS


def test_info_counts_faults_that_are_errors_elsewhere(tmp_path, capsys):
    camera = write_camera(tmp_path, width_px=64, height_px=48)
    (tmp_path / "e.txt").write_text("10 1 2 1\n5 70 2 0\n7 1 2 1\n")
    code, out, _ = run(capsys, "info", tmp_path / "e.txt", "--camera", camera, "--json")
    facts = json.loads(out)
    assert code == 0 and (facts["backward_steps"], facts["out_of_range"]) == (1, 1)
    code, out, _ = run(capsys, "info", tmp_path / "e.txt", "--camera", camera)
    assert code == 0 and "backward steps     1" in out  # no colour where it is no terminal


def test_completion_scripts_know_every_command(capsys):
    for shell in ("bash", "zsh"):
        code, out, _ = run(capsys, "completion", shell)
        assert code == 0 and all(name in out for name in ("estimate", "evaluate", "live", "--modality"))
    script = run(capsys, "completion", "bash")[1]
    checked = subprocess.run(["bash", "-n"], input=script, text=True, capture_output=True)
    assert checked.returncode == 0 and not checked.stderr


def test_every_help_has_examples(capsys):
    for command in ("estimate", "evaluate", "info", "live", "completion"):
        with pytest.raises(SystemExit):
            main.main([command, "--help"])
        assert f"lmmap {command} " in capsys.readouterr().out.split("examples:")[1]


def test_colours_on_a_terminal_only(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.delenv("NO_COLOR", raising=False)
    assert progress.add_colour("x", progress.RED, Terminal()) == "\033[31mx\033[0m"
    assert progress.add_colour("x", progress.RED, io.StringIO()) == "x"
    monkeypatch.setenv("NO_COLOR", "1")
    assert progress.add_colour("x", progress.RED, Terminal()) == "x"


def test_usage_errors_exit_with_2(capsys):
    for argv in ([], ["estimate"], ["estimate", "a", "--modality", "lidar", "-o", "b"], ["dance"]):
        with pytest.raises(SystemExit) as stop:
            main.main(argv)
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


def test_help_does_not_wait_for_the_heavy_imports():
    code = (
        "import sys; from lmmap.cli import main\n"
        "try: main.main(['estimate', '--help'])\n"
        "except SystemExit: print(*sorted({name.split('.')[0] for name in sys.modules}))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT).stdout
    assert "--modality" in out and "lmmap" in out.split()
    assert not {"torch", "numba", "pandas", "scipy", "cv2", "numpy"} & set(out.split("JSON\n")[-1].split())


def test_threads_that_wait_leave_the_cores_to_others():
    """Set before torch is imported, which reads it then; a user's own word counts."""
    code = (
        "import os, sys; from lmmap.cli import main\n"
        "main.main(['completion', 'bash'])\n"
        "print(); print(os.environ['OMP_WAIT_POLICY'], 'torch' in sys.modules)"
    )
    for own, expected in (({}, "PASSIVE False"), ({"OMP_WAIT_POLICY": "ACTIVE"}, "ACTIVE False")):
        environment = {k: v for k, v in os.environ.items() if k != "OMP_WAIT_POLICY"} | own
        out = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, env=environment
        ).stdout
        assert out.splitlines()[-1] == expected


def test_choices_are_those_of_the_modules_that_own_them():
    assert choices.MODALITIES == settings.MODALITIES == tuple(CHANNELS)
    assert (SETS, FORMER) == (choices.SETS, choices.FORMER) and OURS.weights == choices.DEFAULT_WEIGHTS
    assert choices.TIME_UNITS == UNITS
    assert set(choices.SHELLS) <= set(shtab.SUPPORTED_SHELLS)


def test_every_command_names_a_function_that_exists():
    parsers = arguments.parser()._subparsers._group_actions[0].choices
    functions = [parser.get_default("run").split(":") for parser in parsers.values() if parser.heading == OWN]
    assert len(functions) == 6 and all(module.startswith("lmmap.cli.") for module, _ in functions)
    assert all(callable(getattr(importlib.import_module(module), name)) for module, name in functions)


def test_version(capsys):
    with pytest.raises(SystemExit) as stop:
        main.main(["--version"])
    assert stop.value.code == 0 and capsys.readouterr().out.startswith("lmmap ")


def test_the_name_of_the_output_decides_its_format(tmp_path, capsys):
    argv = ("estimate", DRAWN, "--modality", "rgb", "--rate", "5", "-o")
    assert run(capsys, *argv, tmp_path / "p.tum")[0] == 0
    assert run(capsys, *argv, tmp_path / "q.csv", "--format", "tum")[0] == 0
    assert (tmp_path / "p.tum").read_bytes() == (tmp_path / "q.csv").read_bytes()
    assert len((tmp_path / "p.tum").read_text().split("\n")[0].split()) == 8
