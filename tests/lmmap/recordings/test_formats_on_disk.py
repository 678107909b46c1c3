"""Laws of foreign formats: what others wrote comes back exactly, whatever their units and conventions."""

import struct

import cv2
import h5py
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lmmap.recordings import rosbag
from lmmap.recordings.formats import open_recording
from lmmap.types import EVENT, Camera, InputError, event_array

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
START_US = 1_600_000_000_123_456  # an epoch offset


def some_events(count=500):
    rng = np.random.default_rng(0)
    e = np.zeros(count, EVENT)
    e["t_us"] = START_US + np.sort(rng.integers(0, 2_000_000, count))
    e["x"], e["y"], e["p"] = rng.integers(0, 64, count), rng.integers(0, 48, count), rng.random(count) < 0.5
    return e


def some_frames(count=3):
    return np.random.default_rng(1).integers(0, 256, (count, 48, 64, 3), np.uint8)


@pytest.mark.parametrize("unit", ["s", "us"])
@pytest.mark.parametrize("off", [0, -1])
def test_text(tmp_path, unit, off):
    e = some_events()
    times = [f"{t // 10**6}.{t % 10**6:06d}" if unit == "s" else str(t) for t in e["t_us"].tolist()]
    lines = [
        f"{t} {x} {y} {1 if p else off}\n" for t, x, y, p in zip(times, e["x"], e["y"], e["p"], strict=True)
    ]
    (tmp_path / "e.txt").write_text("# t x y p\n" + "".join(lines))
    np.testing.assert_array_equal(open_recording(tmp_path / "e.txt", CAMERA).events, e)


@pytest.mark.parametrize(
    "text", ["1 2 3\n", "1.0 2 3 4 5\n", "1.0 2 3 7\n", "a b c d\n", "1.0 2 99999 1\n", "nan 1 1 1\n", ""]
)
def test_bad_text_is_one_line(tmp_path, text):
    (tmp_path / "e.txt").write_text(text)
    with pytest.raises(InputError, match=r"e\.txt: [^\n]*;[^\n]*$"):
        open_recording(tmp_path / "e.txt", CAMERA)


def test_text_needs_the_sensors_size(tmp_path):
    (tmp_path / "e.txt").write_text("1.0 2 3 1\n")
    with pytest.raises(InputError, match=r"does not state its size.*--camera"):
        open_recording(tmp_path / "e.txt")


def test_dsec_adds_its_offset(tmp_path):
    e = some_events()
    with h5py.File(tmp_path / "e.h5", "w") as file:
        file["t_offset"] = START_US
        file["events/t"] = (e["t_us"] - START_US).astype(np.uint32)
        file["events/x"], file["events/y"] = e["x"].astype(np.uint16), e["y"].astype(np.uint16)
        file["events/p"] = e["p"].astype(np.uint8)
    np.testing.assert_array_equal(open_recording(tmp_path / "e.h5", CAMERA).events, e)


def test_mvsec_has_seconds_and_signed_polarity(tmp_path):
    e, gray = some_events(), some_frames()[..., 0]
    with h5py.File(tmp_path / "e.hdf5", "w") as file:
        file["davis/left/events"] = np.column_stack(
            [e["x"], e["y"], e["t_us"] / 1e6, np.where(e["p"], 1, -1)]
        )
        file["davis/left/image_raw"] = gray
        file["davis/left/image_raw_ts"] = (START_US + 50_000 * np.arange(3)) / 1e6
    back = open_recording(tmp_path / "e.hdf5", CAMERA)
    np.testing.assert_array_equal(back.events, e)
    np.testing.assert_array_equal(back.frames, np.repeat(gray[..., None], 3, -1))
    assert back.frames_t_us.tolist() == [START_US, START_US + 50_000, START_US + 100_000]


@pytest.mark.parametrize("head", ["uint32 height\nuint32 width", "uint32 width\nuint32 height"])
@pytest.mark.parametrize("fields", [("x", "y", "ts", "polarity"), ("ts", "x", "y", "polarity")])
def test_bag_serialised_by_the_library(tmp_path, head, fields):
    """Oracle: the library's own serialiser, in both orders of fields, with gray and compressed images."""
    store, kinds = get_typestore(Stores.ROS1_NOETIC), dict(x="uint16", y="uint16", ts="time", polarity="bool")
    event_msg = "\n".join(f"{kinds[f]} {f}" for f in fields)
    store.register(get_types_from_msg(event_msg, "dvs_msgs/msg/Event"))
    store.register(
        get_types_from_msg(
            f"std_msgs/Header header\n{head}\ndvs_msgs/Event[] events", "dvs_msgs/msg/EventArray"
        )
    )
    kind, e, gray = store.types, some_events(50), some_frames(1)[0, ..., 0].copy()
    Time = kind["builtin_interfaces/msg/Time"]

    def stamp(t_us):
        return Time(sec=int(t_us) // 10**6, nanosec=int(t_us) % 10**6 * 1000)

    header = kind["std_msgs/msg/Header"](seq=0, stamp=stamp(START_US), frame_id="cam")
    Event = kind["dvs_msgs/msg/Event"]
    events = [Event(x=int(x), y=int(y), ts=stamp(t), polarity=bool(p)) for t, x, y, p in e.tolist()]
    _, png = cv2.imencode(".png", gray)
    messages = [
        ("/e", kind["dvs_msgs/msg/EventArray"](header=header, width=64, height=48, events=events)),
        ("/i", kind["sensor_msgs/msg/Image"](header=header, height=48, width=64, encoding="mono8",
                                             is_bigendian=0, step=64, data=gray.ravel())),
    ]  # fmt: skip
    compressed = (
        "/i",
        kind["sensor_msgs/msg/CompressedImage"](header=header, format="png", data=png.ravel()),
    )
    for name, content in (("raw.bag", messages), ("png.bag", [messages[0], compressed])):
        with Writer(tmp_path / name) as bag:
            for topic, m in content:
                connection = bag.add_connection(topic, m.__msgtype__, typestore=store)
                bag.write(connection, START_US * 1000, store.serialize_ros1(m, m.__msgtype__))
        back = open_recording(tmp_path / name, CAMERA)
        np.testing.assert_array_equal(back.events, e)
        np.testing.assert_array_equal(back.frames, np.repeat(gray[None, ..., None], 3, -1))
        assert back.frames_t_us.tolist() == [START_US]


@pytest.mark.parametrize("named", [True, False])
def test_folder_of_images(tmp_path, named):
    frames, folder = some_frames(), tmp_path / "r"
    folder.mkdir()
    for i, f in enumerate(frames):
        cv2.imwrite(str(folder / f"{i:04d}.png"), f[..., ::-1])
    lines = [f"{(START_US + 40_000 * i) / 1e6:.6f}" + f" {i:04d}.png" * named for i in range(3)]
    (folder / ("images.txt" if named else "timestamps.txt")).write_text("\n".join(lines))
    back = open_recording(folder, CAMERA)
    np.testing.assert_array_equal(back.frames, frames)
    assert back.frames_t_us.tolist() == [START_US, START_US + 40_000, START_US + 80_000]
    assert not len(back.events)
    (folder / "0001.png").write_bytes(b"no image")
    with pytest.raises(InputError, match=r"0001\.png: not an image"):
        open_recording(folder, CAMERA)


def test_video(tmp_path):
    """Motion JPEG loses a little; gray levels and times show that frames come in order."""
    path = str(tmp_path / "v.avi")
    video = cv2.VideoWriter(path, cv2.VideoWriter_fourcc(*"MJPG"), 25, (64, 48))
    for level in (20, 120, 220):
        video.write(np.full((48, 64, 3), level, np.uint8))
    video.release()
    back = open_recording(path, CAMERA)
    assert back.frames_t_us.tolist() == [0, 40_000, 80_000]
    np.testing.assert_allclose(back.frames.mean((1, 2, 3)), [20, 120, 220], atol=3)
    (tmp_path / "v.mp4").write_bytes(b"no video")
    with pytest.raises(InputError, match=r"v\.mp4: not a video \(no frame"):
        open_recording(tmp_path / "v.mp4", CAMERA)


def test_columns_refuse_what_events_cannot_hold():
    good = [1.0], [2], [3], [1]
    assert event_array(*good)["t_us"] == 1
    for at, value in ((0, [1e300]), (0, [np.inf]), (1, [40_000]), (3, [2]), (2, [1, 2])):
        with pytest.raises(ValueError, match="events: "):
            event_array(*(value if i == at else c for i, c in enumerate(good)))


def test_kalibr_camchain(tmp_path):
    text = """cam0:
  camera_model: pinhole
  distortion_coeffs: [0.1, -0.2, 0.001, 0.002]
  distortion_model: radtan
  intrinsics: [60.0, 61.0, 31.5, 23.5]
  resolution: [64, 48]
  rostopic: /dvs/image_raw
"""
    (tmp_path / "camchain.yaml").write_text(text)
    assert Camera.load(tmp_path / "camchain.yaml") == Camera(
        64, 48, 60, 61, 31.5, 23.5, (0.1, -0.2, 0.001, 0.002)
    )
    (tmp_path / "fish.yaml").write_text(text.replace("radtan", "equidistant"))
    fish = Camera(64, 48, 60, 61, 31.5, 23.5, (0.1, -0.2, 0.001, 0.002), "equidistant")
    assert Camera.load(tmp_path / "fish.yaml") == fish
    fish.save(tmp_path / "fish.json")
    assert Camera.load(tmp_path / "fish.json") == fish
    (tmp_path / "fish.json").write_text((tmp_path / "fish.json").read_text().replace("equidistant", "magic"))
    for name, content in (("fish.json", None), ("omni.yaml", text.replace("pinhole", "omni"))):
        if content:
            (tmp_path / name).write_text(content)
        with pytest.raises(InputError, match=r"radtan or equidistant|none of pinhole"):
            Camera.load(tmp_path / name)


ROS = """image_width: 64
image_height: 48
camera_name: dvs
camera_matrix: {rows: 3, cols: 3, data: [60, 0, 31.5, 0, 61, 23.5, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [0.1, -0.2, 0.001, 0.002, 0.03]}
"""
OPENCV = """%YAML:1.0
---
image_width: 64
image_height: 48
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 60., 0., 31.5, 0., 61., 23.5, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ 0.1, -0.2, 0.001, 0.002, 0.03 ]
"""


@pytest.mark.parametrize("text", [ROS, OPENCV])
def test_ros_and_opencv_calibrations(tmp_path, text):
    (tmp_path / "c.yaml").write_text(text)
    expected = Camera(64, 48, 60, 61, 31.5, 23.5, (0.1, -0.2, 0.001, 0.002, 0.03))
    assert Camera.load(tmp_path / "c.yaml") == expected
    for old, new in (
        ("0.03 ]", "0.03, 0.4 ]"),
        ("0.03]", "0.03, 0.4]"),
        ("plumb_bob", "fisheye"),
        ("60", ".nan"),
    ):
        if (other := text.replace(old, new)) != text:
            (tmp_path / "other.yaml").write_text(other)
            with pytest.raises(InputError, match=r"other\.yaml: not a camera calibration"):
                Camera.load(tmp_path / "other.yaml")


def test_a_calibration_written_by_opencv_itself(tmp_path):
    """Oracle: cv2.FileStorage, in which cameras are calibrated."""
    storage = cv2.FileStorage(str(tmp_path / "c.yml"), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 64)
    storage.write("image_height", 48)
    storage.write("camera_matrix", CAMERA.K)
    storage.write("distortion_coefficients", np.zeros((5, 1)))
    storage.release()
    assert Camera.load(tmp_path / "c.yml") == CAMERA


def test_dsec_compression(tmp_path):
    """DSEC's files are compressed by a filter that h5py alone does not have."""
    import hdf5plugin

    e = some_events()
    with h5py.File(tmp_path / "e.h5", "w") as file:
        for name, values in (("t", e["t_us"]), ("x", e["x"]), ("y", e["y"]), ("p", e["p"].astype(np.uint8))):
            file.create_dataset(f"events/{name}", data=values, **hdf5plugin.Blosc(cname="zstd"))
    np.testing.assert_array_equal(open_recording(tmp_path / "e.h5", CAMERA).events, e)


@given(st.lists(st.tuples(st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1)), min_size=1))
@example([(2**32 - 1, 2**32 - 1)])
def test_a_bags_times_are_rounded_to_microseconds(times):
    record = np.dtype([("x", "<u2"), ("y", "<u2"), ("s", "<u4"), ("ns", "<u4"), ("p", "u1")])
    events = np.array([(1, 2, s, ns, 1) for s, ns in times], record)
    definition = rosbag.ARRAY_MSG + f"{'=' * 80}\nMSG: dvs_msgs/Event\n{rosbag.EVENT_MSG}"
    raw = bytes(16) + struct.pack("<III", 48, 64, len(events)) + events.tobytes()
    size_px, decoded = rosbag._events(raw, definition)
    assert size_px == (64, 48)
    assert decoded["t_us"].tolist() == [s * 10**6 + (ns + 500) // 1000 for s, ns in times]
