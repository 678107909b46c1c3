"""Laws of written recordings: they come back exactly, and are complete under their names, or not there."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import dv_processing as dv
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_formats import assert_round_trip, assert_same, broken, recording

from lmmap.recordings.formats import open_recording
from lmmap.types import InputError
from lmmap_lab.bench import rosbag_writer
from lmmap_lab.bench.writers import WRITERS, write_recording

TESTS = Path(__file__).parents[2]
SHARED = TESTS / "lmmap" / "recordings", TESTS, TESTS.parent / "benchmarks"


@pytest.fixture(params=WRITERS)
def suffix(request):
    return request.param


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32), st.integers(0, 300), st.integers(0, 3), st.sampled_from(sorted(WRITERS)))
def test_round_trip_is_exact(tmp_path_factory, seed, events, frames, suffix):
    original = recording(seed, events if events + frames else 1, frames)
    assert_round_trip(write_recording, original, tmp_path_factory.mktemp("r") / f"r{suffix}")


def test_many_packets_keep_their_order(tmp_path):
    original = recording(events=250_001, frames=0)
    write_recording(original, tmp_path / "r.aedat4")
    assert_same(original, open_recording(tmp_path / "r.aedat4"))


def test_library_reads_what_we_write(tmp_path):
    """Oracle: channel order and times as dv-processing itself sees them."""
    original = recording()
    write_recording(original, tmp_path / "r.aedat4")
    frame = dv.io.MonoCameraRecording(str(tmp_path / "r.aedat4")).getNextFrame()
    np.testing.assert_array_equal(frame.image[..., ::-1], original.frames[0])
    assert frame.timestamp == original.frames_t_us[0]


def test_rewriting_without_truth_leaves_no_stale_truth(tmp_path, suffix):
    path = tmp_path / f"r{suffix}"
    write_recording(recording(), path)
    assert open_recording(path).truth is not None
    write_recording(recording(truth=False), path)
    assert open_recording(path).truth is None
    assert {p.name for p in tmp_path.iterdir()} == {f"r{suffix}", "r.camera.json"}


@pytest.mark.parametrize("fault", [dict(t_us=(100, 0)), dict(x=(7, 64)), dict(y=(7, -1))])
def test_backward_time_and_foreign_pixels_are_not_written(tmp_path, fault):
    with pytest.raises(ValueError, match=r"runs backward by|event outside 64 x 48 px"):
        write_recording(broken(**fault), tmp_path / "r.aedat4")
    assert not list(tmp_path.iterdir())


def test_ros_cannot_write_negative_times():
    with pytest.raises(InputError, match="shift"):
        rosbag_writer.header(-1)


def test_failed_write_leaves_nothing(tmp_path, suffix, monkeypatch):
    path = tmp_path / f"r{suffix}"
    write_recording(recording(1), path)
    before = path.read_bytes()

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    with pytest.raises(InputError, match="No space left") as caught:
        write_recording(recording(2), path)
    assert str(tmp_path) in str(caught.value)
    assert path.read_bytes() == before
    assert {p.name for p in tmp_path.iterdir()} == {f"r{suffix}", "r.camera.json", "r.truth.csv"}


def test_folder_that_is_none(tmp_path, suffix):
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "absent", tmp_path / "file"):
        with pytest.raises(InputError, match="cannot write"):
            write_recording(recording(), folder / f"r{suffix}")
    with pytest.raises(InputError, match="ends in"):
        write_recording(recording(), tmp_path / "r.mp4")


def test_full_disk_is_an_error_not_an_abort(tmp_path):
    """A file-size limit stands for the full disk; in a process of its own, as it cannot be raised again."""
    code = (
        "import sys, resource; sys.path[:0] = sys.argv[2:]\n"
        "from test_formats import recording; from lmmap import InputError\n"
        "from lmmap_lab.bench.writers import write_recording\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (500_000, 500_000))\n"
        "try: write_recording(recording(events=100_000), sys.argv[1])\n"
        "except InputError as error: print(error)"
    )
    run = subprocess.run(
        [sys.executable, "-c", code, tmp_path / "r.aedat4", *SHARED],
        capture_output=True, text=True,
    )  # fmt: skip
    assert run.returncode == 0 and "cannot write (File too large)" in run.stdout
    assert not list(tmp_path.glob("*.aedat4"))


def test_equal_recordings_make_equal_bytes(tmp_path):
    """Also where memory held other things between the fields of an event."""
    first = recording()
    dirty = np.frombuffer(bytearray(b"\xff" * first.events.nbytes), first.events.dtype)
    for name in dirty.dtype.names:
        dirty[name] = first.events[name]
    assert dirty.tobytes() != first.events.tobytes()
    for name, events in (("a", first.events), ("b", dirty)):
        write_recording(replace(first, events=events), tmp_path / f"{name}.h5")
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
