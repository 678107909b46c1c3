"""Hostile recordings, cameras, ports and truths: one line, soon, in little memory; never a traceback."""

import json
import os
import re
import shutil
import struct
from dataclasses import replace
from pathlib import Path

import cv2
import h5py
import library_files
import numpy as np
import pytest
from attack_directed import directed_files
from attack_sound import CAMERA, sound_files

from lmmap.cli.progress import Bar
from lmmap.recordings import bounded_bag, formats, stream
from lmmap.recordings.formats import open_recording, open_stream
from lmmap.recordings.hdf5_datasets import rows_at_once
from lmmap.recordings.limits import MAX_CHUNK_BYTES, MAX_TIME_US
from lmmap.recordings.pose_files import read_truth
from lmmap.types import EVENT, Camera, InputError, Port, Recording
from lmmap_readers.health import health


@pytest.fixture(scope="session")  # of a module, it would be made anew when a worker comes back to it
def directed(tmp_path_factory):
    return directed_files(tmp_path_factory.mktemp("directed"))


@pytest.fixture(scope="session")
def ros2_bag(tmp_path_factory):
    return sound_files(tmp_path_factory.mktemp("sound"), np.random.default_rng(0))["ros2"]


BINARY = (".aedat4", ".bag", ".h5", ".avi", ".mcap", ".db3", ".raw", ".dat", ".es", ".npy", ".png")
SUFFIXES = (*BINARY, ".txt", ".csv")
DIRECTED = (
    *(f"{kind}{suffix}" for kind in ("fifo", "zero") for suffix in SUFFIXES),
    *(f"sparse{suffix}" for suffix in SUFFIXES if suffix != ".avi"),
    *(f"{name}-{kind}.mcap" for name in ("lie", "promise", "absurd") for kind in ("lz4", "zstd")),
    *("line.txt", "int64.txt", "seconds.txt"),
    *("never.h5", "never-large.h5", "never-contiguous.h5", "large-chunks.h5", "bomb.h5", "external.h5"),
    *("filter.h5", "frames.h5", "bomb.bag", "promise.bag", "repeated.mcap", "computed.db3"),
    *("packed file", "packed messages", "aliases"),
    *("many.npy", "absurd.npy", "object.npy", "wide.npy", "nested.npy"),
    *("columns.csv", "twice.csv", "digits.csv", "huge.csv"),
    *("unicode.raw", "head.raw", "version.dat", "size.es"),
    *("gigapixel folder", "cut folder", "huge times", "int times", "nan times"),
)


@pytest.mark.parametrize("name", DIRECTED)
def test_each_directed_attack_is_one_line(directed, name):
    with pytest.raises(InputError) as caught:
        open_recording(directed[name], CAMERA)
    message = str(caught.value)
    assert directed[name].name in message and "\n" not in message and ";" in message and len(message) < 500


def test_times_are_bounded_for_who_counts_faults_too(tmp_path):
    e = np.zeros(2, EVENT)
    e["t_us"] = [0, MAX_TIME_US + 1]
    source = stream.Source(tmp_path, (64, 48), lambda: iter([e]))
    with pytest.raises(InputError, match="beyond any clock"):
        health(stream.Stream("r", CAMERA, source, checked=False))


def test_a_chunk_of_a_bag_is_as_long_as_it_says():
    with pytest.raises(ValueError, match="does not decompress to its 10 bytes"):
        bounded_bag._decompress(None, 10, b"x" * 11)


def test_our_own_mistakes_are_not_damaged_files(tmp_path):
    with pytest.raises(AttributeError), stream.input_errors(tmp_path, "damaged", "copy it again"):
        None.no_such_method()


def test_links_to_other_files_are_not_followed(tmp_path):
    with h5py.File(tmp_path / "other.h5", "w") as file:
        for name in "txyp":
            file[f"events/{name}"] = np.zeros(5, np.int64)
    with h5py.File(tmp_path / "r.h5", "w") as file:
        file["events"] = h5py.ExternalLink("other.h5", "/events")
    with pytest.raises(InputError, match="another file"):
        open_recording(tmp_path / "r.h5", CAMERA)


RECORDS = np.zeros(5, [("a", "<i4")])


@pytest.mark.parametrize(
    "contents",
    [
        {"CD/events": None},  # a group
        {"CD/events": np.dtype("<i4")},  # a type by itself
        {"CD/events": h5py.SoftLink("/CD")},
        {"CD/events": h5py.Empty("<i4")},
        {"CD/events": np.zeros(5)},
        {"CD/events": np.zeros(5, [("t", "S5"), ("x", "<u2"), ("y", "<u2"), ("p", "<i2")])},
        *(
            {f"events/{name}": np.dtype("<i4") if name == odd else np.ones(5) for name in "txyp"}
            for odd in "tp"
        ),
        *({f"events/{name}": RECORDS if name == odd else np.ones(5) for name in "txyp"} for odd in "tp"),
        {"t_offset": RECORDS[0], **{f"events/{name}": np.ones(5) for name in "txyp"}},
        {"t_offset": np.float64(1e300), **{f"events/{name}": np.ones(5) for name in "txyp"}},
        {"davis/left/events": np.zeros((5, 4), RECORDS.dtype)},
        {"davis/left/image_raw": None},
        {"davis/left": np.zeros(5)},
    ],
    ids=str,
)
def test_other_objects_where_hdf5_should_hold_events(tmp_path, contents):
    with h5py.File(tmp_path / "r.h5", "w") as file:
        file.create_group("CD")
        for name, value in contents.items():
            file.require_group(name) if value is None else file.__setitem__(name, value)
    with pytest.raises(InputError, match=r"r\.h5: [^\n]*;"):
        open_recording(tmp_path / "r.h5", CAMERA)


@pytest.mark.parametrize("chunks", [None, (10,), (10**6,)])
def test_rows_are_read_within_a_chunks_bytes(tmp_path, chunks):
    """However wide a record is, and however many rows of a narrow column a chunk holds."""
    wide = np.dtype([(f"f{k}", "<f8") for k in range(1000)])
    with h5py.File(tmp_path / "r.h5", "w") as file:
        records = file.create_dataset("wide", (2 * 10**6,), wide, chunks=chunks and (10,))
        column = file.create_dataset("narrow", (2 * 10**6,), "u1", chunks=chunks)
        rows = rows_at_once(250_000, records, column)
        assert rows >= 1 and rows * (wide.itemsize + 1) <= MAX_CHUNK_BYTES
        assert rows_at_once(250_000, column) == max(250_000, *(chunks or (1,)))


@pytest.mark.parametrize("span_us", [(0, 10**400), (-(10**30), 0), (0, MAX_TIME_US + 1)])
def test_a_span_beyond_any_clock_is_refused(tmp_path, monkeypatch, span_us):
    """Headers and descriptions state it; what the events say is checked elsewhere."""
    path = tmp_path / "r.raw"
    path.touch()
    source = stream.Source(path, (64, 48), span_us=span_us)
    monkeypatch.setitem(formats.READERS, ".raw", lambda _: source)
    with pytest.raises(InputError, match=r"r\.raw: .*beyond any clock"):
        open_stream(path, CAMERA)


@pytest.mark.parametrize("key", ["nanoseconds", "nanoseconds_since_epoch", "message_count", "version"])
@pytest.mark.parametrize("value", ["9" * 400, "-" + "9" * 400, "[]", "{}", ".nan", "text", "1e300"])
def test_numbers_of_a_ros2_bags_description(ros2_bag, tmp_path, key, value):
    bag = shutil.copytree(ros2_bag, tmp_path / "bag")
    text = (bag / "metadata.yaml").read_text()
    changed = re.sub(rf"\b{key}: .*", f"{key}: {value}", text)
    assert changed != text
    (bag / "metadata.yaml").write_text(changed)
    try:
        recording = open_stream(bag, CAMERA)
        Bar(recording, "event").close()
        health(recording)
    except InputError as error:
        assert "bag: " in str(error) and "\n" not in str(error)


@pytest.mark.parametrize("name", ["metadata.yaml", "*.mcap"])
@pytest.mark.parametrize(
    "make", [os.mkfifo, *(lambda path, to=to: path.symlink_to(to) for to in ("/dev/zero", "/proc/version"))]
)
def test_no_pipes_and_devices_in_a_ros2_bags_folder(ros2_bag, tmp_path, name, make):
    bag = shutil.copytree(ros2_bag, tmp_path / "bag")
    (path,) = bag.glob(name)
    path.unlink()
    make(path)
    with pytest.raises(InputError, match="a device or a pipe"):
        open_stream(bag, CAMERA)


def test_a_file_that_a_ros2_bag_names_often_is_not_unpacked_as_often(ros2_bag, tmp_path):
    bag = shutil.copytree(ros2_bag, tmp_path / "bag")
    (path,) = bag.glob("*.mcap")
    text = (bag / "metadata.yaml").read_text()
    assert f"- {path.name}\n" in text
    (bag / "metadata.yaml").write_text(re.sub(rf"( *- {path.name}\n)", r"\1" * 100, text, count=1))
    with pytest.raises(InputError, match=f"{path.name} is named twice"):
        open_stream(bag, CAMERA)


def test_no_pipe_beside_the_images_of_a_folder(tmp_path):
    cv2.imwrite(str(tmp_path / "0.png"), np.zeros((48, 64, 3), np.uint8))
    (tmp_path / "timestamps.txt").write_text("1.0\n")
    os.mkfifo(tmp_path / "events.txt")
    with pytest.raises(InputError, match="a device or a pipe"):
        open_recording(tmp_path, CAMERA)


GOOD = json.loads(json.dumps(dict(width_px=64, height_px=48, fx_px=60.0, fy_px=60.0, cx_px=31.5, cy_px=23.5)))


@pytest.mark.parametrize(
    "change",
    [
        *({"width_px": v} for v in (64.0, True, "64", None, [64], 0, -1, 10**400, 1e9)),
        *({"fx_px": v} for v in (1e-300, 1e300, True, "60", None, 10**400, float("inf"), float("nan"))),
        *({"distortion": [0.1] * count} for count in (1, 2, 3, 6, 7, 8, 15)),
        *({"distortion": v} for v in ([1e300] * 5, ["a"] * 4, 0.1, "abcd", {"k1": 0.1}, [True] * 4)),
        {"colour": "red"},
    ],
)
def test_cameras_are_checked_field_by_field(tmp_path, change):
    path = tmp_path / "camera.json"
    path.write_text(json.dumps(GOOD | change))
    with pytest.raises(InputError, match=r"camera\.json: not a camera calibration \([^\n]*\);") as caught:
        Camera.load(path)
    assert next(iter(change)) in str(caught.value) and len(str(caught.value)) < 500


@pytest.mark.parametrize("text", ["[", "[]", "3", "null", '"x"', "[" * 10**5, "{}", '{"a":' * 10**5, "\x00"])
def test_documents_that_are_no_cameras(tmp_path, text):
    for name in ("c.json", "c.yaml"):
        (tmp_path / name).write_text(text)
        with pytest.raises(InputError, match=rf"{name[0]}\.{name[2:]}: not a"):
            Camera.load(tmp_path / name)


YAML = """image_width: 64
image_height: 48
camera_matrix: {data: [60, 0, 31.5, 0, 60, 23.5, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {data: [0.1, -0.2, 0.001, 0.002, 0.03]}
"""
KALIBR = """cam0:
  camera_model: pinhole
  distortion_coeffs: [0.1, -0.2, 0.001, 0.002]
  distortion_model: radtan
  intrinsics: [60.0, 61.0, 31.5, 23.5]
  resolution: [64, 48]
"""
VALUES = (
    *("{}", "[]", "{{}: 1}", "{[1]: 2}", "? {a: 1}", "[[1, [2]]]", "*a", "&a [1]", "'", "\x85"),
    *("null", "true", "9" * 400, "9" * 5000, ".nan", "-.inf", "0x", "1_000", "60:60"),
    *("2001-99-99", "2001-01-01", "!!int ''", "!!float ''", "!!bool x", "!!timestamp x", "!!set {a}"),
    *("!!binary a", "!!python/none 1", "!x y", "<<", "="),
)


@pytest.mark.filterwarnings("ignore:.*check the calibration")
@pytest.mark.parametrize("value", VALUES)
@pytest.mark.parametrize("whole", [YAML, KALIBR], ids=["ros", "kalibr"])
def test_any_value_anywhere_in_a_calibration(tmp_path, whole, value):
    """It is read, perhaps with a note, or refused in one line: each value and name replaced in turn."""
    (tmp_path / "c.yaml").write_text(whole)
    assert Camera.load(tmp_path / "c.yaml").size_px == (64, 48)
    refused = 0
    for place in re.finditer(r"[^\s:\[\]{},]+", whole):
        (tmp_path / "c.yaml").write_text(whole[: place.start()] + value + whole[place.end() :])
        try:
            Camera.load(tmp_path / "c.yaml")
        except InputError as error:
            refused += 1
            assert "c.yaml: " in str(error) and "\n" not in str(error) and len(str(error)) < 500
    assert refused


def test_yaml_that_expands_is_refused(tmp_path):
    lines = ["a: &a [x, x, x, x, x, x, x, x, x]"]
    lines += [f"{n}: &{n} [{', '.join(['*' + m] * 9)}]" for m, n in zip("abcdefgh", "bcdefghi", strict=True)]
    (tmp_path / "laughs.yaml").write_text("\n".join(lines))
    with pytest.raises(InputError, match="refers to its own parts"):
        Camera.load(tmp_path / "laughs.yaml")
    (tmp_path / "long.yaml").write_text("#" * 2**21)
    with pytest.raises(InputError, match="more than 1048576"):
        Camera.load(tmp_path / "long.yaml")


WINDOWS = {"window_radius_m": 0.030, "window_size_m": (0.020, 0.016)}


@pytest.mark.parametrize(
    "change",
    [
        *({"symmetry": v} for v in (2.5, float("nan"), 1e9, 10**9, 0, -3, True, "3", None)),
        *({"marker_size_m": v} for v in ([0.05], [0.05, 0.01, 0.01], "ab", 0.05, [0.05, "a"], [0.05, 1e300])),
        {"ring_radius_m": float("inf")},
        *({"plate_height_tolerance": v} for v in (0, 10, -0.1, float("nan"), "10 %", True, None)),
        {"ring_width_tolerance": 0},
        {"marker_radius_tolerance": 10},
        {"marker_radius_tolerance": 0.0},
        *({"window_size_m": v} for v in ([-0.01, 0.01], [0.01], 0.01, [0.01, 0], [0.2, 0.02], [1e300, 1])),
        {"window_radius_m": -0.03},
        {"window_radius_m": 0.04, "window_size_m": [0.01, 0.02]},
        {"window_radius_m": 0.025, "window_size_m": [0.05, 0.02]},
    ],
)
def test_ports_are_checked_field_by_field(tmp_path, change):
    replace(Port.lm_map(), **WINDOWS).save(tmp_path / "port.json")
    values = json.loads((tmp_path / "port.json").read_text())
    (tmp_path / "port.json").write_text(json.dumps(values | change))
    with pytest.raises(InputError, match=next(iter(change))) as error:
        Port.load(tmp_path / "port.json")
    assert "\n" not in str(error.value) and "port.json" in str(error.value)


@pytest.mark.parametrize(
    "change, said",
    [
        ({"window_radius_m": 0.040}, "leave the plate"),
        ({"window_size_m": [0.032, 0.016]}, "overlap the markers"),
        ({"window_radius_m": 0.006}, "overlap one another"),
        ({"window_size_m": [0.020, 0]}, "two zeros"),
    ],
)
def test_windows_lie_on_the_plate_apart_from_the_markers(tmp_path, change, said):
    port = replace(Port.lm_map(), **WINDOWS)
    port.save(tmp_path / "port.json")
    values = json.loads((tmp_path / "port.json").read_text())
    (tmp_path / "port.json").write_text(json.dumps(values | change))
    with pytest.raises(InputError, match=said):
        Port.load(tmp_path / "port.json")
    with pytest.raises(ValueError, match=said):
        replace(port, **change)


HEAD = "t_us,x_m,y_m,z_m,qx,qy,qz,qw\n"
ROW = "{},0,0,{},0,0,0,1\n"


@pytest.mark.parametrize(
    "text",
    [
        "",
        HEAD,
        HEAD + ROW.format(0, 1),
        HEAD + ROW.format(2**63, 1) + ROW.format(2**64, 1),
        HEAD + ROW.format(0, 1) + ROW.format(MAX_TIME_US + 1, 1),
        HEAD + ROW.format(0, "1e300") + ROW.format(1, 1),
        HEAD + ROW.format(0, "nan") + ROW.format(1, 1),
        HEAD + ROW.format(1, 1) + ROW.format(0, 1),
    ],
)
def test_truths_that_are_none(tmp_path, text):
    (tmp_path / "truth.csv").write_text(text)
    with pytest.raises(InputError, match=r"truth\.csv: [^\n]*;"):
        read_truth(tmp_path / "truth.csv")


def test_empty_packets_end_a_recording_soon(tmp_path):
    """Each of zeros is a packet of stream 0 with no bytes: eight gigabytes of them are a billion packets."""
    whole = Path(sound_files(tmp_path, np.random.default_rng(0))[".aedat4"])
    content = bytearray(whole.read_bytes())
    (size,) = struct.unpack_from("<I", content, 14)
    content[18 + size : 18 + size + 8] = struct.pack("<ii", 0, 0)
    whole.write_bytes(content)
    with pytest.raises(InputError, match="damaged"):
        open_stream(whole, CAMERA)


def test_a_list_with_and_without_names(tmp_path):
    (tmp_path / "images.txt").write_text("0.5 0.png\n1.5\n")
    with pytest.raises(InputError, match="with and without a name"):
        open_recording(tmp_path, CAMERA)


def test_sound_files_are_still_read(tmp_path):
    files = sound_files(tmp_path, np.random.default_rng(0))
    for kind in (".aedat4", ".bag", ".h5", ".txt", "folder", ".avi"):
        back = open_recording(files[kind], CAMERA)
        assert len(back.events) + len(back.frames) >= 4, kind


def test_an_aedat4_stream_without_a_kind_is_none(tmp_path):
    """Its header's attribute is there, and empty."""
    path = tmp_path / "e.aedat4"
    e = np.zeros(10, EVENT)
    e["t_us"] = np.arange(10)
    library_files.aedat4(
        Recording("e", CAMERA, e, np.zeros((0, 48, 64, 3), np.uint8), np.zeros(0, int)), path
    )
    content = path.read_bytes()
    assert content.count(b">EVTS</attr>") == 1
    path.write_bytes(content.replace(b">EVTS</attr>", b"></attr>    "))
    source = open_stream(path, CAMERA).source
    assert source.details()["streams"] == ["", "FRME"] and not list(source.events())
