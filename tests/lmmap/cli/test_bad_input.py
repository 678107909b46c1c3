"""Bad input: one line that names the file, the problem and a remedy; exit code 1; nothing lost."""

import json
import os
import re
from pathlib import Path

import drawn
import numpy as np
import pytest
from library_files import write_recording

from lmmap.cli import main
from lmmap.pipeline.weights import load_network, weight_path
from lmmap.recordings.formats import open_recording, suffixes
from lmmap.shipped import ROOT
from lmmap.types import EVENT, Camera, Recording

DRAWN = drawn.file(6)
BEFORE = "what was there before\n"


def write_camera(folder, **changes):
    path = folder / "camera.json"
    values = dict(width_px=640, height_px=480, fx_px=500, fy_px=500, cx_px=320, cy_px=240) | changes
    Camera(**values).save(path)
    return path


@pytest.fixture
def refused(tmp_path, capsys):
    """Run ``lmmap estimate`` (or another command) on bad input and give back its one line."""
    poses = tmp_path / "poses.csv"
    poses.write_text(BEFORE)

    def run(recording, *extra, command="estimate", output=poses):
        argv = [command, str(recording), *map(str, extra)]
        if command == "estimate":
            argv += ["--modality", "event", "-o", str(output), "--overwrite"]
        assert main.main(argv) == 1
        out, err = capsys.readouterr()
        assert out == "" and len(err.splitlines()) == 1, err
        assert re.fullmatch(r"lmmap: .+: .+[;:,] .+\n|lmmap: --\w+ \S+: give .+\n", err), (
            "file, problem and remedy"
        )
        assert poses.read_text() == BEFORE
        return err

    return run


@pytest.fixture
def small(tmp_path):
    """A camera of 64 x 48 px."""
    return write_camera(tmp_path, width_px=64, height_px=48, cx_px=31.5, cy_px=23.5)


def text(path: Path, rows) -> Path:
    path.write_text("".join(f"{t} {x} {y} {p}\n" for t, x, y, p in rows))
    return path


def test_missing(refused, tmp_path):
    assert "no such file" in refused(tmp_path / "absent.aedat4")


def test_directory(refused, tmp_path):
    (tmp_path / "empty").mkdir()
    assert "not a folder of images" in refused(tmp_path / "empty")


@pytest.mark.parametrize("suffix", [suffix for suffix in suffixes() if suffix != "folder"])
def test_empty(refused, tmp_path, small, suffix):
    (tmp_path / f"empty{suffix}").touch()
    assert f"empty{suffix}" in refused(tmp_path / f"empty{suffix}", "--camera", small)


@pytest.mark.parametrize("suffix", [suffix for suffix in suffixes() if suffix != "folder"])
def test_wrong_format_under_a_right_name(refused, tmp_path, small, suffix):
    (tmp_path / f"fake{suffix}").write_bytes(b"PK\x03\x04 no recording, " + bytes(range(256)) * 20)
    assert f"fake{suffix}" in refused(tmp_path / f"fake{suffix}", "--camera", small)


def test_truncated_at_twenty_places(refused, tmp_path):
    whole = DRAWN.read_bytes()
    for k in range(20):
        cut = tmp_path / "cut.aedat4"
        cut.write_bytes(whole[: k * len(whole) // 20])
        assert "cut.aedat4" in refused(cut)
        assert "cut.aedat4" in refused(cut, command="info")


def test_backward_time(refused, tmp_path, small):
    path = text(tmp_path / "e.txt", [(5, 1, 1, 1), (9, 1, 1, 1), (7, 1, 1, 1)])
    assert "backward by 2 us after number 1" in refused(path, "--camera", small)


@pytest.mark.parametrize("x, y", [(64, 1), (1, 48), (-1, 1)])
def test_coordinates_out_of_range(refused, tmp_path, small, x, y):
    path = text(tmp_path / "e.txt", [(5, 1, 1, 1), (9, x, y, 1)])
    assert f"outside 64 x 48 px, number 1 at ({x}, {y})" in refused(path, "--camera", small)


def test_signed_polarity_is_read_and_others_are_refused(refused, tmp_path, small):
    path = text(tmp_path / "e.txt", [(5, 1, 1, -1), (9, 1, 1, 1)])
    assert open_recording(path, small).events["p"].tolist() == [False, True]
    path = text(tmp_path / "e.txt", [(5, 1, 1, -1), (9, 1, 1, 0)])
    assert "polarities {0, 1} or {-1, 1}" in refused(path, "--camera", small)


def test_zero_events(refused, tmp_path, small):
    empty = Recording("e", Camera.load(small), np.zeros(0, EVENT), np.zeros((0, 48, 64, 3), np.uint8),
                      np.zeros(0, np.int64))  # fmt: skip
    write_recording(empty, tmp_path / "e.h5")
    assert "fewer than" in refused(tmp_path / "e.h5", "--camera", small)
    assert "neither events nor frames" in refused(tmp_path / "e.h5", "--camera", small, command="info")


def test_nan_in_the_calibration(refused, tmp_path):
    values = json.loads(write_camera(tmp_path, width_px=346, height_px=260).read_text())
    (tmp_path / "nan.json").write_text(json.dumps(values | {"fx_px": float("nan")}))
    assert "nan.json" in refused(DRAWN, "--camera", tmp_path / "nan.json")


def test_calibrations_that_are_none(refused, tmp_path):
    for name, content in (("a.yaml", "a: [1, 2"), ("b.json", "[]"), ("c.yaml", "image_width: 346")):
        (tmp_path / name).write_text(content)
        assert name in refused(DRAWN, "--camera", tmp_path / name)
        assert name in refused(DRAWN, "--port", tmp_path / name)


def test_camera_of_another_size(refused, tmp_path):
    assert "346 x 260 px, but" in refused(DRAWN, "--camera", write_camera(tmp_path))


def test_settings_that_are_none(refused):
    assert "--rate" in refused(DRAWN, "--rate", "-3")
    assert "--events" in refused(DRAWN, "--events", "0")
    assert "weights" in refused(DRAWN, "--weights", "nowhere")
    assert "video" in refused(DRAWN, "--video", "film.gif")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no device that is always full")
def test_disk_full(refused):
    assert "No space left" in refused(DRAWN, "--rate", "5", output="/dev/full")


def test_read_only_output(refused, tmp_path):
    closed = tmp_path / "closed"
    closed.mkdir()
    closed.chmod(0o500)
    folder = (
        Path("/sys") if os.access(closed, os.W_OK) else closed
    )  # nobody forbids root, but the kernel does
    assert "cannot write" in refused(DRAWN, "--rate", "5", output=folder / "poses.csv")
    closed.chmod(0o700)
    assert "is a folder" in refused(DRAWN, output=closed)
    assert "no folder" in refused(DRAWN, output=tmp_path / "no" / "poses.csv")


# --- strangers' files cannot execute code ---------------------------------------------------------


class Bomb:
    def __reduce__(self):
        return (exec, ("raise SystemExit('executed')",))


def test_pickled_weights_are_refused(refused, tmp_path):
    import torch

    for name in ("ring", "reflector"):
        torch.save({"weights": Bomb()}, tmp_path / weight_path(name, "event").name)
    assert "no readable weights" in refused(DRAWN, "--weights", tmp_path)


def test_yaml_makes_no_objects(refused, tmp_path):
    (tmp_path / "bomb.yaml").write_text("!!python/object/apply:os._exit [3]")
    assert "bomb.yaml" in refused(DRAWN, "--camera", tmp_path / "bomb.yaml")


def test_nothing_in_the_module_can_unpickle():
    word = re.compile(
        r"pickle(?!=False)|\bshelve\b|\bmarshal\b|torch\.load|joblib\.load|unsafe_load|yaml\.load\(|\beval\(|\bexec\("
    )
    net_eval = re.compile(r"\.eval\(\)|def eval\(")  # a network's mode; the name of Mitsuba's method
    for path in (p for folder in ("lmmap", "lmmap_lab", "benchmarks") for p in (ROOT / folder).rglob("*.py")):
        lines = path.read_text().splitlines()
        matches = [line for line in lines if word.search(net_eval.sub("", line))]
        assert not matches, f"{path.name}: {matches}"


def test_a_shipped_weight_file_loads():
    """What the tests above refuse is refused for what is in it."""
    assert load_network(weight_path("ring", "event"), "event").modality == "event"
