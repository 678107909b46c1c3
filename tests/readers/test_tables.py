"""Laws of tables of events: columns are found by their names, and times by the unit that a name states."""

import numpy as np
import pytest

from lmmap.recordings.formats import open_recording, open_stream
from lmmap.types import EVENT, Camera, InputError
from lmmap_readers import tables

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
START_US = 1_600_000_000_123_456


def some_events(count=300):
    rng = np.random.default_rng(0)
    e = np.zeros(count, EVENT)
    e["t_us"] = START_US + np.sort(rng.integers(0, 2_000_000, count))
    e["x"], e["y"], e["p"] = rng.integers(0, 64, count), rng.integers(0, 48, count), rng.random(count) < 0.5
    return e


def csv_of(path, header, times, events, off=0):
    rows = zip(times, events["x"], events["y"], events["p"], strict=True)
    path.write_text(header + "\n" + "".join(f"{t},{x},{y},{1 if p else off}\n" for t, x, y, p in rows))
    return path


def decimal(t_us, digits):
    """A time in units of 10**digits us, exactly."""
    return f"{t_us // 10**digits}.{t_us % 10**digits:0{digits}d}"


UNITS = {
    "t": str,
    "timestamp": str,
    "ts": str,
    "t_us": str,
    "time [us]": str,
    "timestamp (ns)": lambda t: f"{t}000",
    "t_ns": lambda t: f"{t}499",
    "time": lambda t: decimal(t, 6),
    "time_s": lambda t: decimal(t, 6),
    "t (ms)": lambda t: decimal(t, 3),
}


@pytest.mark.parametrize("name", UNITS)
@pytest.mark.parametrize("off", [0, -1])
def test_units_of_time(tmp_path, name, off):
    events = some_events()
    path = csv_of(tmp_path / "e.csv", f"{name},x,y,p", map(UNITS[name], events["t_us"].tolist()), events, off)
    np.testing.assert_array_equal(open_recording(path, CAMERA).events, events)


@pytest.mark.parametrize("header", ["Timestamp,col,row,polarity", "t, x , y ,pol", "t,x@64,y@48,on"])
def test_spellings_of_columns(tmp_path, header):
    events = some_events()
    path = csv_of(tmp_path / "e.csv", header, events["t_us"], events)
    np.testing.assert_array_equal(open_recording(path, CAMERA).events, events)
    assert open_stream(path, CAMERA).source.size_px == ((64, 48) if "@" in header else None)


def test_other_columns_and_orders(tmp_path):
    (tmp_path / "e.csv").write_text("# a comment\npolarity,note,y,x,t\n1,7,2,3,5\n0,7,4,5,6\n")
    expected = np.array([(5, 3, 2, True), (6, 5, 4, False)], EVENT)
    np.testing.assert_array_equal(open_recording(tmp_path / "e.csv", CAMERA).events, expected)


@pytest.mark.parametrize("t_kind, name", [("<i8", "t"), ("<u8", "timestamp"), ("<f8", "t"), ("<i8", "t_ns")])
@pytest.mark.parametrize("p_kind", ["?", "u1", "i1"])
def test_structured_arrays(tmp_path, t_kind, name, p_kind):
    events = some_events()
    rows = np.zeros(len(events), [("x", "<u2"), ("y", "<u2"), ("p", p_kind), (name, t_kind)])
    factor = {"<f8": 1e-6}.get(t_kind, 1000 if name == "t_ns" else 1)
    rows["x"], rows["y"], rows["p"], rows[name] = (
        events["x"],
        events["y"],
        events["p"],
        events["t_us"] * factor,
    )
    np.save(tmp_path / "e.npy", rows)
    np.testing.assert_array_equal(open_recording(tmp_path / "e.npy", CAMERA).events, events)


@pytest.mark.parametrize(
    "text, problem",
    [
        ("", "no column for t"),
        ("1,2,3,1\n4,5,6,0\n", "no column for t among 1, 2, 3, 1"),
        ("t,x,y\n1,2,3\n", "no column for p"),
        ("t,time,x,y,p\n1,1,2,3,1\n", "more than one column for t"),
        ("t,x,y,p\n1,2,3,1,9\n", "does not hold 4 numbers"),
        ("t,x,y,p\n1,2,3\n", "not finite"),
        ("t,x,y,p\n1,a,3,1\n", "does not hold 4 numbers"),
        ("t,x,y,p\n1,2,3,5\n", "polarities"),
        ("t,x,y,p\n1,40000,3,1\n", "does not fit 16 bit"),
        ("t_s,x,y,p\n90000000000000000,2,3,1\n", "does not fit 64 bit"),
        ("t,x,y,p\n9,2,3,1\n5,2,3,1\n", "runs backward by 4 us"),
        ("t,x,y,p\n9,64,3,1\n", "outside 64 x 48 px"),
    ],
)
def test_bad_tables_are_one_line(tmp_path, text, problem):
    (tmp_path / "e.csv").write_text(text)
    with pytest.raises(InputError, match=rf"e\.csv: [^\n]*(?:{problem})[^\n]*;[^\n]*$"):
        open_recording(tmp_path / "e.csv", CAMERA)


def test_what_was_read_before_a_bad_line_is_kept(tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "CHUNK", 10)
    (tmp_path / "e.csv").write_text("t,x,y,p\n" + "".join(f"{t},2,3,1\n" for t in range(25)) + "25,a,3,1\n")
    chunks = open_stream(tmp_path / "e.csv", CAMERA).chunks()
    assert np.concatenate([next(chunks), next(chunks)])["t_us"].tolist() == list(range(20))
    with pytest.raises(InputError, match=r"e\.csv: [^\n]*does not hold 4 numbers"):
        next(chunks)


def test_arrays_that_are_no_events(tmp_path):
    for name, array in (
        ("plain.npy", np.zeros((5, 4))),
        ("names.npy", np.zeros(5, [("a", "i4")])),
        ("objects.npy", np.array([{}], object)),
        ("times.npy", np.zeros(5, [("t", "S4"), ("x", "i2"), ("y", "i2"), ("p", "?")])),
        ("nothing.npy", np.zeros(5, [("t", "S0"), ("x", "S0"), ("y", "S0"), ("p", "S0")])),
    ):
        np.save(tmp_path / name, array, allow_pickle=True)
    whole = tmp_path / "whole.npy"
    np.save(whole, np.zeros(500, [("t", "i8"), ("x", "i2"), ("y", "i2"), ("p", "?")]))
    (tmp_path / "head.npy").write_bytes(whole.read_bytes()[:40])
    (tmp_path / "magic.npy").write_bytes(b"no array")
    for path in sorted(tmp_path.iterdir()):
        if path != whole:
            with pytest.raises(InputError, match=rf"{path.name}: not a table of events \([^\n]*\); [^\n]*$"):
                open_recording(path, CAMERA)
    assert len(open_recording(whole, CAMERA).events) == 500


def test_a_cut_array_gives_its_whole_rows_and_then_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "CHUNK", 100)
    events, path = some_events(250), tmp_path / "cut.npy"
    np.save(path, events)
    path.write_bytes(path.read_bytes()[:-1])
    chunks = open_stream(path, CAMERA).chunks()
    np.testing.assert_array_equal(np.concatenate([next(chunks) for _ in range(3)]), events[:-1])
    with pytest.raises(InputError, match=r"cut\.npy: [^\n]*ends after 249 of 250 rows[^\n]*;[^\n]*$"):
        next(chunks)


def test_names_that_only_the_third_version_of_the_format_can_hold(tmp_path):
    events = some_events(5)
    rows = np.zeros(5, [("x", "<u2"), ("y", "<u2"), ("p", "?"), ("time [\u03bcs]", "<i8")])
    for ours, theirs in zip(("x", "y", "p", "t_us"), rows.dtype.names, strict=True):
        rows[theirs] = events[ours]
    with pytest.warns(UserWarning, match="NumPy >= 1.17"):
        np.save(tmp_path / "e.npy", rows)
    np.testing.assert_array_equal(open_recording(tmp_path / "e.npy", CAMERA).events, events)
