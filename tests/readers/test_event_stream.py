"""Laws of Event Stream files: what the published layout says, bit for bit, however the file is cut."""

import struct
import warnings

import faery
import numpy as np
import pytest
from foreign_files import es

from lmmap.cli import main
from lmmap.recordings.formats import open_recording, open_stream
from lmmap.types import EVENT, Camera, InputError
from lmmap_readers import event_stream

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
HEAD = b"Event Stream" + bytes([2, 0, 0, 1]) + struct.pack("<HH", *CAMERA.size_px)


def random_events(count=3000, seconds=0.2):
    """Bursts, pauses of many times 127 us, and every residue of a pause."""
    rng = np.random.default_rng(0)
    e = np.zeros(count, EVENT)
    e["t_us"] = np.cumsum(rng.integers(0, 130, count) * rng.integers(0, 2, count))
    e["t_us"][count // 2 :] += round(1e6 * seconds)
    e["x"], e["y"], e["p"] = rng.integers(0, 64, count), rng.integers(0, 48, count), rng.random(count) < 0.5
    return e


def written(folder, content):
    path = folder / "e.es"
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("piece", [1, 7, 1 << 16])
def test_events_come_back_exactly(tmp_path, monkeypatch, piece):
    """However the bytes fall into pieces."""
    monkeypatch.setattr(event_stream, "PIECE", piece)
    events = random_events(300 if piece < 10 else 30_000)
    path = written(tmp_path, es(events, CAMERA.size_px))
    np.testing.assert_array_equal(open_recording(path, CAMERA).events, events)
    assert open_stream(path, CAMERA).source.size_px == CAMERA.size_px


def test_by_hand(tmp_path):
    """ON at 3 us, lowest row; nothing; 2 x 127 us; OFF 126 us later in the row above it."""
    codes = bytes([3 << 1 | 1, 5, 0, 0, 0, 0xFE, 0xFF, 0xFF, 126 << 1, 0, 0, 1, 0])
    events = open_recording(written(tmp_path, HEAD + codes), CAMERA).events
    assert events.tolist() == [(3, 5, 47, True), (383, 0, 46, False)]


def test_another_implementation_agrees_both_ways(tmp_path):
    """Oracle: faery reads what the encoder writes, and we read what faery writes."""
    events = random_events()
    rows = np.zeros(len(events), faery.EVENTS_DTYPE)
    names = (("t_us", "t"), ("x", "x"), ("y", "y"), ("p", "on"))
    for ours, theirs in names:
        rows[theirs] = events[ours]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        faery.events_stream_from_array(rows, CAMERA.size_px).to_file(tmp_path / "theirs.es", zero_t0=False)
        read = np.concatenate(
            list(faery.events_stream_from_file(written(tmp_path, es(events, CAMERA.size_px))))
        )
    np.testing.assert_array_equal(open_recording(tmp_path / "theirs.es", CAMERA).events, events)
    for ours, theirs in names:
        np.testing.assert_array_equal(read[theirs], events[ours])


def test_a_cut_file_gives_what_it_holds_and_then_one_line(tmp_path):
    events = random_events()
    path = written(tmp_path, es(events, CAMERA.size_px)[:-2])
    chunks = open_stream(path, CAMERA).chunks()
    np.testing.assert_array_equal(next(chunks), events[:-1])
    with pytest.raises(InputError, match=r"e\.es: .*ends 3 bytes into an event of 5.*; [^\n]*$"):
        next(chunks)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "does not begin"),
        (HEAD[:-1], "does not begin"),
        (b"x" + HEAD[1:], "does not begin"),
        (HEAD[:12] + bytes([1, 0, 0]) + HEAD[15:], r"version 1\.0\.0, expected 2"),
        (HEAD[:15] + b"\2" + HEAD[16:], "ATIS events"),
        (HEAD[:15] + b"\x63" + HEAD[16:], r"unknown \(99\) events"),
        (HEAD[:16] + bytes(4), "sensor of 0 x 0 px"),
        (HEAD, "neither events nor frames"),
        (HEAD + b"\xff" * 200_000, "neither events nor frames"),
        (HEAD + b"\0" + b"\xff" * 4, r"outside 64 x 48 px|16 bit"),
    ],
)
def test_what_is_no_stream_of_a_dvs_is_one_line(tmp_path, content, reason, capsys):
    path = written(tmp_path, content)
    with pytest.raises(InputError, match=rf"e\.es: [^\n]*({reason})[^\n]*; [^\n]*$"):
        open_recording(path, CAMERA)
    if reason != "neither events nor frames":
        assert main.main(["info", str(path), "--camera", "davis346:6mm"]) == 1
        assert len(capsys.readouterr().err.splitlines()) == 1
