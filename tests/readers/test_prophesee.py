"""Laws of Prophesee's formats: what the published layouts say, bit for bit, however the file is cut."""

import importlib
import struct
import warnings

import h5py
import numpy as np
import pytest
from foreign_files import dat, evt2, evt3, evt21

from lmmap.cli import main
from lmmap.recordings import hdf5_datasets
from lmmap.recordings.formats import open_recording, open_stream
from lmmap.types import EVENT, Camera, InputError
from lmmap_readers import prophesee

CAMERA = Camera(1280, 720, 1600.0, 1600.0, 639.5, 359.5)
LOOP_US = {"evt3": 1 << 24, "evt2": 1 << 34, "evt21": 1 << 34, "legacy": 1 << 34}


def events_of(rows) -> np.ndarray:
    return np.array([tuple(row) for row in rows], EVENT)


def some_events(count=3000, start_us=0, duration_us=40_000_000):
    """Single events, and rows in which many pixels of one polarity fire at once."""
    rng = np.random.default_rng(0)
    rows = []
    for t_us in start_us + np.sort(rng.integers(0, duration_us, count // 3)):
        y, p, x = rng.integers(720), bool(rng.integers(2)), rng.integers(1200)
        rows += [(t_us, x + dx, y, p) for dx in np.flatnonzero(rng.random(70) < rng.choice([0.02, 0.5]))]
    return events_of(rows)


ENCODERS = {"evt2": evt2, "evt21": evt21, "legacy": lambda e: evt21(e, legacy=True), "evt3": evt3, "dat": dat}


@pytest.fixture(params=ENCODERS)
def encoding(request):
    return request.param


def written(folder, encoding, events):
    path = folder / ("e.dat" if encoding == "dat" else "e.raw")
    path.write_bytes(ENCODERS[encoding](events))
    return path


@pytest.mark.parametrize("piece", [24, 1 << 18])
def test_events_come_back_exactly(tmp_path, monkeypatch, encoding, piece):
    """However the words fall into pieces: a piece of 24 bytes cuts vectors and times from one another."""
    monkeypatch.setattr(prophesee, "PIECE", piece)
    events = some_events(300 if piece == 24 else 3000)
    path = written(tmp_path, encoding, events)
    np.testing.assert_array_equal(open_recording(path, CAMERA).events, events)
    assert open_stream(path, CAMERA).source.size_px == (1280, 720)


def test_time_goes_on_where_its_counter_starts_again(tmp_path, encoding):
    loop_us = LOOP_US.get(encoding, 1 << 32)
    events = some_events(start_us=loop_us - 1_000_000, duration_us=2_000_000)
    np.testing.assert_array_equal(open_recording(written(tmp_path, encoding, events), CAMERA).events, events)


def test_evt3_by_hand(tmp_path):
    """TIME_HIGH 1, TIME_LOW 5, y 7, an ON event at x 3; OFF at 100, 111 and, in the next vector, 113."""
    words = [0x8001, 0x6005, 0x0007, 0x2803, 0x3064, 0x4801, 0x4002]
    (tmp_path / "e.raw").write_bytes(b"% evt 3.0\n% geometry 1280x720\n" + struct.pack("<7H", *words))
    expected = [(4101, 3, 7, True), (4101, 100, 7, False), (4101, 111, 7, False), (4101, 113, 7, False)]
    np.testing.assert_array_equal(open_recording(tmp_path / "e.raw", CAMERA).events, events_of(expected))


def test_evt2_and_evt21_by_hand(tmp_path):
    """High time 3, low time 1: 193 us.  ON at (5, 6); of two words of 32, bits 0 and 31."""
    head = b"% evt 2.0\n% geometry 1280x720\n"
    words = [0x80000003, 1 << 28 | 1 << 22 | 5 << 11 | 6]
    (tmp_path / "e.raw").write_bytes(head + struct.pack("<2I", *words))
    np.testing.assert_array_equal(
        open_recording(tmp_path / "e.raw", CAMERA).events, events_of([(193, 5, 6, 1)])
    )
    words = [0x80000003 << 32, (1 << 22 | 64 << 11 | 6) << 32 | 0x8000_0001]
    (tmp_path / "e.raw").write_bytes(head.replace(b"2.0", b"2.1") + struct.pack("<2Q", *words))
    expected = events_of([(193, 64, 6, 0), (193, 95, 6, 0)])
    np.testing.assert_array_equal(open_recording(tmp_path / "e.raw", CAMERA).events, expected)


def test_events_before_the_first_time_and_row_are_dropped(tmp_path):
    """A low part of the time before any high part says nothing, and an x without a y is no event."""
    words = [0x2801, 0x0007, 0x2802, 0x6005, 0x2803, 0x8001, 0x2804, 0x6006, 0x2805]
    (tmp_path / "e.raw").write_bytes(b"% evt 3.0\n" + struct.pack("<9H", *words))
    events = open_recording(tmp_path / "e.raw", CAMERA).events
    np.testing.assert_array_equal(events, events_of([(4102, 5, 7, True)]))
    (tmp_path / "e.raw").write_bytes(b"% evt 3.0\n" + struct.pack("<4H", 0x8001, 0x6005, 0x2801, 0x0007))
    with pytest.raises(InputError, match="neither events nor frames"):
        open_recording(tmp_path / "e.raw", CAMERA)


def test_a_cut_file_gives_what_it_holds_and_then_one_line(tmp_path, encoding):
    events = some_events()
    path = written(tmp_path, encoding, events)
    path.write_bytes(path.read_bytes()[:-1])
    chunks = open_stream(path, CAMERA).chunks()
    first = next(chunks)
    np.testing.assert_array_equal(first, events[: len(first)])
    assert len(first) >= len(events) - 32
    with pytest.raises(
        InputError, match=r"e\.(raw|dat): not a recording .*ends \d bytes into a word.*; [^\n]*$"
    ):
        next(chunks)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"no header",
        b"% evt 4.0\n",
        b"% format EVT3;endianness=big\n% end\n",
        b"% " + b"x" * 70_000,
        b"% date 2020\n% end\n\x00\x00",
    ],
)
def test_what_is_no_raw_file_is_one_line(tmp_path, content, capsys):
    (tmp_path / "e.raw").write_bytes(content)
    assert main.main(["info", str(tmp_path / "e.raw"), "--camera", "evk4:8mm"]) == 1
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize(
    "content", [b"", b"% Version 1\n\x0c\x08", b"% Version 2\n\x0e\x08", b"% Version 2\n\x0c"]
)
def test_what_is_no_dat_file_is_one_line(tmp_path, content):
    (tmp_path / "e.dat").write_bytes(content)
    with pytest.raises(InputError, match=r"e\.dat: not a recording of Prophesee's \([^\n]*\); [^\n]*$"):
        open_recording(tmp_path / "e.dat", CAMERA)


def test_random_bytes_under_a_right_header_are_refused(tmp_path, encoding):
    path = written(tmp_path, encoding, some_events(30))
    start = (
        path.read_bytes().find(b"\x0c\x08") + 2 if encoding == "dat" else path.read_bytes().find(b"end\n") + 4
    )
    path.write_bytes(path.read_bytes()[:start] + np.random.default_rng(1).bytes(80_000))
    with pytest.raises(InputError, match=r"outside 1280 x 720 px|runs backward|polarities"):
        open_recording(path, CAMERA)


def test_time_that_runs_back_is_an_error(tmp_path, encoding):
    events = events_of([(500_000, 1, 1, 1), (100_000, 2, 2, 0)])
    with pytest.raises(InputError, match="runs backward by 400000 us"):
        open_recording(written(tmp_path, encoding, events), CAMERA)


@pytest.mark.parametrize("geometry", ["1280x720", None])
def test_hdf5(tmp_path, geometry):
    events = some_events()
    kind = np.dtype([("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")])
    rows = np.zeros(len(events), kind)
    for ours, theirs in (("t_us", "t"), ("x", "x"), ("y", "y"), ("p", "p")):
        rows[theirs] = events[ours]
    with h5py.File(tmp_path / "e.hdf5", "w") as file:
        file.create_dataset("CD/events", data=rows, chunks=True, compression="gzip")
        if geometry:
            file.attrs["geometry"] = geometry
    np.testing.assert_array_equal(open_recording(tmp_path / "e.hdf5", CAMERA).events, events)
    source = open_stream(tmp_path / "e.hdf5", CAMERA).source
    assert source.size_px == ((1280, 720) if geometry else None)
    assert source.span_us == tuple(events["t_us"][[0, -1]])


def test_hdf5_in_prophesees_own_compression_names_the_remedy(tmp_path):
    with h5py.File(tmp_path / "e.hdf5", "w") as file:
        properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        properties.set_chunk((16,))
        properties.set_filter(hdf5_datasets.ECF, h5py.h5z.FLAG_OPTIONAL)
        kind = h5py.h5t.py_create(np.dtype([("x", "<u2"), ("y", "<u2"), ("p", "<i2"), ("t", "<i8")]))
        h5py.h5d.create(
            file.create_group("CD").id, b"events", kind, h5py.h5s.create_simple((16,)), properties
        )
    with pytest.raises(InputError, match=r"ECF.*export the recording as RAW"):
        open_recording(tmp_path / "e.hdf5", CAMERA)


@pytest.mark.parametrize("package", ["evt3", "faery"])
def test_another_implementation_agrees(tmp_path, package):
    """Oracles: evt3 reads what the encoder above writes; we read what faery writes."""
    oracle = importlib.import_module(package)
    events = some_events(duration_us=16_000_000)  # evt3 wants a TIME_HIGH in each 40 ms before it rolls over
    if package == "evt3":
        theirs = oracle.decode_file(str(written(tmp_path, "evt3", events)))
        for ours, name in (("t_us", "t"), ("x", "x"), ("y", "y"), ("p", "p")):
            np.testing.assert_array_equal(events[ours], getattr(theirs, name))
        return
    rows = np.zeros(len(events), oracle.EVENTS_DTYPE)
    for ours, name in (("t_us", "t"), ("x", "x"), ("y", "y"), ("p", "on")):
        rows[name] = events[ours]
    for name, version in (("two.raw", "evt2"), ("three.raw", "evt3"), ("e.dat", "dat2")):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            oracle.events_stream_from_array(rows, (1280, 720)).to_file(
                tmp_path / name, version=version, zero_t0=False
            )
        np.testing.assert_array_equal(open_recording(tmp_path / name, CAMERA).events, events)
