"""Two cameras that do not go together, by their clocks or their mounts, and rates that cannot be."""

import json
from dataclasses import replace

import cv2
import drawn
import h5py
import numpy as np
import pytest
from library_files import write_recording

from lmmap.cli import main
from lmmap_readers.flips import FLIPS, flip_events, flip_frame

R, HOUR_US = drawn.recording(5), 3_600_000_000


@pytest.fixture
def run(capsys, tmp_path):
    def run(*argv):
        code = main.main([str(a) for a in argv])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    R.camera.save(tmp_path / "c.json")
    return run


def aedat4(path, r):
    write_recording(r, path)
    return path


def mvsec(path, r):
    with h5py.File(path, "w") as file:
        e = r.events
        columns = [e["x"], e["y"], e["t_us"] * 1e-6, np.where(e["p"], 1, -1)]
        file["davis/left/events"] = np.column_stack(columns)
        file["davis/left/image_raw"] = r.frames[..., 0]
        file["davis/left/image_raw_ts"] = r.frames_t_us * 1e-6
    return path


def rpg(path, r):
    path.mkdir()
    rows = (f"{t * 1e-6:.6f} {x} {y} {int(p)}\n" for t, x, y, p in r.events.tolist())
    (path / "events.txt").write_text("".join(rows))
    lines = []
    for k, (t_us, frame) in enumerate(r.timed_frames()):
        cv2.imwrite(str(path / f"{k}.png"), frame[..., ::-1])
        lines.append(f"{t_us * 1e-6:.6f} {k}.png\n")
    (path / "images.txt").write_text("".join(lines))
    return path


@pytest.mark.parametrize("name, write", [("r.aedat4", aedat4), ("r.h5", mvsec), ("r", rpg)])
@pytest.mark.parametrize("shift_us", [HOUR_US, 1_468_939_993_000_000])
def test_frames_on_another_clock_are_not_fused(tmp_path, run, name, write, shift_us):
    """Nor evaluated together; what one camera's data say is there all the same."""
    path = write(tmp_path / name, replace(R, frames_t_us=R.frames_t_us + shift_us))
    given = path, "--camera", tmp_path / "c.json"
    for more in ((), ("--track",)):
        code, _, err = run("estimate", *given, "--modality", "fused", "-o", tmp_path / "o.csv", *more)
        assert code == 1 and len(err.splitlines()) == 1 and "do not overlap, so their clocks differ" in err
    code, out, _ = run("info", *given, "--json")
    facts = json.loads(out)
    assert code == 0 and facts["overlap_s"] == 0 and "do not overlap" in facts["clocks"]
    assert facts["frames_at_s"][0] == pytest.approx(facts["events_at_s"][0] + shift_us * 1e-6, abs=0.03)


def test_both_spans_overlap_and_rates_are_told(tmp_path, run):
    _, out, _ = run("info", aedat4(tmp_path / "r.aedat4", R))
    lines = dict(line.split("  ", 1) for line in out.splitlines())
    assert lines["frames at s"].strip() == "0.000 to 0.200" and lines["clocks"].strip() == "may be one"
    assert float(lines["frame rate hz"]) == 20 and float(lines["overlap s"]) == pytest.approx(0.2, abs=0.01)


@pytest.mark.parametrize("flip", FLIPS)
def test_a_flip_is_its_own_inverse_and_the_same_for_both_cameras(flip):
    """Oracle: a frame that has a bright pixel for each event."""
    e = R.events[:500]
    shown = np.zeros((260, 346, 3), np.uint8)
    shown[e["y"], e["x"]] = 255
    turned = flip_events(e, flip, (346, 260))
    expected = np.zeros_like(shown)
    expected[turned["y"], turned["x"]] = 255
    np.testing.assert_array_equal(flip_frame(shown, flip), expected)
    np.testing.assert_array_equal(flip_events(turned, flip, (346, 260)), e)
    assert not np.array_equal(turned, e)


@pytest.mark.parametrize(
    "camera, flip, more",
    [
        ("event", "x", ("--track",)),
        ("rgb", "y", ("--track",)),
        ("event", "180", ()),
        ("rgb", "x", ("--rate", "30")),
    ],
)
def test_a_mirrored_camera_is_named_and_flipped_back(tmp_path, run, camera, flip, more):
    """No pose of either is ok, and with the flip all are."""
    changes = {"frames": np.stack([flip_frame(f, flip) for f in R.frames])}
    if camera == "event":
        changes = {"events": flip_events(R.events, flip, R.camera.size_px)}
    path = aedat4(tmp_path / "r.aedat4", replace(R, **changes))
    argv = "estimate", path, "--modality", "fused", "--json", *more
    code, out, err = run(*argv, "-o", tmp_path / "o.csv")
    assert code == 0 and "ok" not in json.loads(out)["statuses"]
    assert len(err.splitlines()) == 1 and "contradict each other" in err and "--flip" in err
    code, out, err = run(*argv, "--flip", f"{camera}:{flip}", "-o", tmp_path / "p.csv")
    assert code == 0 and not err and json.loads(out)["statuses"]["ok"] > 6


@pytest.mark.parametrize("rate", ["1e-310", "1e-300", "1e-9", "0", "-1", "nan", "inf", "1e5"])
@pytest.mark.parametrize("modality", ["event", "fused", "rgb"])
def test_rates_that_are_none_are_one_line(tmp_path, run, rate, modality):
    path, output = drawn.file(3), tmp_path / "o.csv"
    code, _, err = run("estimate", path, "--modality", modality, f"--rate={rate}", "-o", output)
    assert code == 1 and len(err.splitlines()) == 1 and "give a number of estimates per second" in err


@pytest.mark.parametrize("rate", ["5", "0.001"])
def test_a_period_longer_than_the_recording_is_named(tmp_path, run, rate):
    path, output = drawn.file(3), tmp_path / "o.csv"
    code, _, err = run("estimate", path, "--modality", "event", "--rate", rate, "-o", output)
    assert code == 1 and f"lasts 0.1 s, and no tick of --rate {rate} is after 35000 events" in err
