"""Units of event times that a file does not state: read as they are, or said in one line."""

import warnings

import h5py
import numpy as np
import pytest

from lmmap.recordings.formats import open_recording, open_stream
from lmmap.types import EVENT, Camera, InputError

CAMERA = Camera(346, 260, 324.0, 324.0, 172.5, 129.5)
ENDINGS = ("txt", "csv", "npy", "h5")


def some_events(count=20_000, seconds=1.5, seed=0):
    rng = np.random.default_rng(seed)
    e = np.zeros(count, EVENT)
    e["t_us"] = np.sort(rng.integers(0, int(seconds * 1e6), count))
    e["x"], e["y"], e["p"] = rng.integers(0, 346, count), rng.integers(0, 260, count), rng.random(count) < 0.5
    return e


def write(path, t, e):
    """Events whose times are these numbers (N,) or texts."""
    columns = e["x"], e["y"], e["p"].astype(int)
    if path.suffix in (".txt", ".csv"):
        sign = " " if path.suffix == ".txt" else ","
        lines = [
            sign.join(map(str, row)) for row in zip(t.tolist(), *(c.tolist() for c in columns), strict=True)
        ]
        path.write_text("\n".join(["t,x,y,p"] * (path.suffix == ".csv") + lines) + "\n")
    elif path.suffix == ".npy":
        np.save(path, np.rec.fromarrays([t, *columns], names="t,x,y,p").view(np.ndarray))
    else:
        with h5py.File(path, "w") as file:
            for name, values in zip("txyp", (t, *columns), strict=True):
                file[f"events/{name}"] = values
    return path


def stored(e, unit):
    """Times as numbers in a unit; an f before it makes them floats."""
    ns = e["t_us"] * 1000
    factor = {"s": 10**9, "ms": 10**6, "us": 1000, "ns": 1}[unit.lstrip("f")]
    return ns / factor if unit[0] == "f" else ns // factor


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("unit", ["us", "fs"])
@pytest.mark.parametrize("count, seconds", [(1000, 1.5), (20_000, 0.3), (300, 2.0), (5, 1.0)])
def test_whole_numbers_are_microseconds_and_floats_are_seconds(tmp_path, ending, unit, count, seconds):
    e = some_events(count, seconds)
    path = write(tmp_path / f"e.{ending}", stored(e, unit), e)
    np.testing.assert_array_equal(open_recording(path, CAMERA).events, e)


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("unit", ["ns", "fus", "fns", "ms"])
@pytest.mark.parametrize("count, seconds", [(300_000, 1.5), (20_000, 0.02)])
def test_another_unit_is_said_and_settled_by_a_word(tmp_path, ending, unit, count, seconds):
    e = some_events(count if ending in ("npy", "h5") else count // 10, seconds, seed=1)
    path, named = write(tmp_path / f"e.{ending}", stored(e, unit), e), unit.lstrip("f")
    if unit != "ms" or len(e) == 300_000:  # fewer are no rate that a sensor cannot have
        with pytest.warns(UserWarning, match=rf"{ending}: its times are taken as .*--time-unit .*{named}"):
            open_stream(path, CAMERA, checked=False)
    back = open_recording(path, CAMERA, time_unit=named).events
    np.testing.assert_allclose(back["t_us"], e["t_us"], atol=1000 if unit == "ms" else 1)
    assert np.array_equal(back["x"], e["x"])


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_sensor_that_is_quiet_or_busy_is_not_noted(tmp_path, ending):
    quiet, busy = some_events(20_000, 19.0), some_events(50_000, 0.005)
    simulated = some_events(200_000, 2.0)
    simulated["t_us"] -= simulated["t_us"] % 1000  # a simulator that steps by milliseconds
    coarse = some_events(50_000, 0.5)
    coarse["t_us"] -= coarse["t_us"] % 33_000
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for e in (quiet, busy, simulated, coarse):
            open_recording(write(tmp_path / f"e.{ending}", e["t_us"], e), CAMERA)


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e308])
@pytest.mark.parametrize("ending", ENDINGS)
def test_times_that_are_none_are_refused_as_before(tmp_path, ending, value):
    e = some_events(300)
    t = e["t_us"] / 1e6
    t[200] = value
    with pytest.raises(InputError, match=f"e.{ending}: "):
        open_recording(write(tmp_path / f"e.{ending}", t, e), CAMERA)


@pytest.mark.parametrize("name", ["t_ns", "t [s]"])
def test_a_unit_that_is_stated_is_not_doubted(tmp_path, name):
    e = some_events(2000, 3000.0)
    write(tmp_path / "e.csv", e["t_us"] * 1000 if name == "t_ns" else e["t_us"] / 1e6, e)
    (tmp_path / "e.csv").write_text((tmp_path / "e.csv").read_text().replace("t,x", f"{name},x", 1))
    np.testing.assert_array_equal(open_recording(tmp_path / "e.csv", CAMERA).events, e)


def test_an_offset_has_the_unit_of_its_times(tmp_path):
    e = some_events(1000)
    for unit, offset in (("fs", 1000.5), ("us", 1_000_500_000)):
        with h5py.File(write(tmp_path / "e.h5", stored(e, unit), e), "a") as file:
            file["t_offset"] = offset
        stream = open_stream(tmp_path / "e.h5", CAMERA)
        np.testing.assert_array_equal(stream.collect().events["t_us"], e["t_us"] + 1_000_500_000)
        assert stream.source.span_us == tuple(e["t_us"][[0, -1]] + 1_000_500_000)


def test_options_that_do_not_fit(tmp_path):
    (tmp_path / "e.es").write_bytes(b"Event Stream")
    with pytest.raises(InputError, match=r"--time-unit ns is for events as text, CSV, npy or HDF5"):
        open_recording(tmp_path / "e.es", CAMERA, time_unit="ns")
    with pytest.raises(InputError, match=r"e\.es: --stream 1 is for AEDAT4 or HDF5 of several cameras"):
        open_recording(tmp_path / "e.es", CAMERA, stream=1)
    with pytest.raises(ValueError, match="time_unit: expected one of s, ms, us, ns"):
        open_recording(tmp_path / "e.es", CAMERA, time_unit="minutes")


# --- E2VID's text ---------------------------------------------------------------------------------


@pytest.mark.parametrize("order", ["txyp", "xytp", "xypt", "pxyt", "tpxy"])
@pytest.mark.parametrize("size", ["346 260\n", "# a comment\n346 260\n", ""])
@pytest.mark.parametrize("floats", [True, False])
def test_columns_of_text_in_any_order(tmp_path, order, size, floats):
    e = some_events(500)
    columns = {"t": [f"{t / 1e6:.6f}" for t in e["t_us"].tolist()] if floats else e["t_us"].tolist()}
    columns |= {"x": e["x"].tolist(), "y": e["y"].tolist(), "p": e["p"].astype(int).tolist()}
    rows = zip(*(columns[name] for name in order), strict=True)
    (tmp_path / "e.txt").write_text(size + "".join(" ".join(map(str, row)) + "\n" for row in rows))
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        stream = open_stream(tmp_path / "e.txt", CAMERA)
    assert [f"columns as {' '.join(order)}" in str(n.message) for n in notes] == [True] * (order != "txyp")
    assert stream.source.size_px == ((346, 260) if size else None)
    np.testing.assert_array_equal(stream.collect().events, e)


def test_the_size_of_e2vid_s_text_is_the_sensor_s(tmp_path):
    (tmp_path / "e.txt").write_text("240 180\n0.000001 5 6 1\n0.000002 7 8 0\n")
    with pytest.raises(InputError, match="recorded at 240 x 180 px"):
        open_recording(tmp_path / "e.txt", CAMERA)
