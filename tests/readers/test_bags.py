"""Laws of bags of both kinds as people have them: encodings, packets, stamps of zero, depth beside images."""

import struct
import warnings

import cv2
import numpy as np
import pytest
import test_prophesee as prophesee
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from test_rosbag2 import CAMERA, START_US, libcaer_cmp, mono, some_events, some_frame

from lmmap.cli import main
from lmmap.recordings import rosbag
from lmmap.recordings.formats import open_recording
from lmmap.types import InputError
from lmmap_readers import packets

STORES = {1: get_typestore(Stores.ROS1_NOETIC), 2: get_typestore(Stores.ROS2_HUMBLE)}
for ros, text in ((1, rosbag.EVENT_MSG), (2, rosbag.EVENT_MSG.replace("time", "builtin_interfaces/Time"))):
    STORES[ros].register(get_types_from_msg(text, "dvs_msgs/msg/Event"))
    STORES[ros].register(get_types_from_msg(rosbag.ARRAY_MSG, "dvs_msgs/msg/EventArray"))
    for name in packets.PACKETS:
        STORES[ros].register(get_types_from_msg(packets.DEFINITION, name))
ARRAY, PACKET, IMAGE = "dvs_msgs/msg/EventArray", packets.PACKETS[0], "sensor_msgs/msg/Image"
both_kinds = pytest.mark.parametrize("ros", [1, 2])


def time(store, t_us):
    return store.types["builtin_interfaces/msg/Time"](sec=t_us // 10**6, nanosec=t_us % 10**6 * 1000)


def bag(path, ros, messages):
    """Messages ``(topic, kind, stamp_us, recorded_us, fields)``, in a bag of ROS 1 or 2."""
    store, path = STORES[ros], path / ("b.bag" if ros == 1 else "b")
    writer = Writer1(path) if ros == 1 else Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
    with writer:
        known = {}
        for topic, kind, stamp_us, recorded_us, fields in messages:
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=store)
            head = {"stamp": time(store, stamp_us), "frame_id": "c"} | ({"seq": 0} if ros == 1 else {})
            message = store.types[kind](header=store.types["std_msgs/msg/Header"](**head), **fields)
            raw = store.serialize_ros1(message, kind) if ros == 1 else store.serialize_cdr(message, kind)
            writer.write(known[topic], recorded_us * 1000, bytes(raw))
    return path


def image(values, encoding, big=False):
    data = np.frombuffer(values.astype(values.dtype.newbyteorder(">" if big else "<")).tobytes(), np.uint8)
    fields = dict(encoding=encoding, is_bigendian=int(big), step=len(data) // 48, data=data)
    return dict(height=48, width=64) | fields


def packet(encoding, packed, base_us=0):
    return dict(height=48, width=64, seq=0, time_base=base_us * 1000, encoding=encoding, is_bigendian=False,
                events=np.frombuffer(packed, np.uint8))  # fmt: skip


def array(ros, events):
    store = STORES[ros]
    event = store.types["dvs_msgs/msg/Event"]
    rows = [event(x=x, y=y, ts=time(store, t), polarity=p) for t, x, y, p in events.tolist()]
    return dict(height=48, width=64, events=rows)


def read(path):
    """A bag's recording, and its notes."""
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        recording = open_recording(path, CAMERA)
    return recording, [str(note.message) for note in notes]


def one_image(tmp_path, ros, fields):
    recording, notes = read(bag(tmp_path, ros, [("/i", IMAGE, START_US, START_US, fields)]))
    return recording.frames[0], notes


# --- encodings ------------------------------------------------------------------------------------


@both_kinds
@pytest.mark.parametrize("bits", [10, 12, 14, 16])
@pytest.mark.parametrize("encoding", ["mono16", "16UC1", "rgb16", "bgr16", "16UC3", "rgba16", "16UC4"])
def test_images_of_16_bits_are_scaled_by_the_bits_in_use(tmp_path, ros, encoding, bits):
    """The largest value of the depth is white; what has all 16 bits is not noted."""
    deep = np.random.default_rng(0).integers(0, 1 << bits, (48, 64, 3), np.uint16)
    deep[0, 0] = (1 << bits) - 1
    expected = (deep >> bits - 8).astype(np.uint8)
    if encoding in ("mono16", "16UC1"):
        deep, expected = deep[..., 0], np.repeat(expected[..., :1], 3, -1)
    elif encoding in ("rgba16", "16UC4"):
        order = slice(None, None, -1 if encoding == "16UC4" else 1)
        deep = np.dstack([deep[..., order], np.full((48, 64), 7, np.uint16)])
    elif encoding != "rgb16":
        deep = deep[..., ::-1]
    frame, notes = one_image(tmp_path, ros, image(deep, encoding, big=bits == 12))
    np.testing.assert_array_equal(frame, expected)
    assert [f"take {bits} of them" in note for note in notes] == ([True] if bits < 16 else [])


@both_kinds
def test_other_encodings_that_are_images(tmp_path, ros):
    """Grey of YUV's own range, 16 to 235, to 0 to 255; a field of one colour behind Bayer's filter."""
    grey = np.random.default_rng(1).integers(16, 236, (48, 64), np.uint8)
    expected = np.clip((grey - 16.0) * 255 / 219, 0, 255)
    for k, (encoding, where) in enumerate({"yuv422": 1, "uyvy": 1, "yuv422_yuy2": 0, "yuyv": 0}.items()):
        pair = np.full((48, 64, 2), 128, np.uint8)
        pair[..., where] = grey
        (folder := tmp_path / str(k)).mkdir()
        frame, notes = one_image(folder, ros, image(pair, encoding))
        np.testing.assert_allclose(frame, np.repeat(expected[..., None], 3, -1), atol=1.5)
        assert not notes
    bgra = np.dstack([some_frame()[..., ::-1], np.zeros((48, 64), np.uint8)])
    (folder := tmp_path / "8UC4").mkdir()
    np.testing.assert_array_equal(one_image(folder, ros, image(bgra, "8UC4"))[0], some_frame())
    red = np.zeros((48, 64), np.uint16)
    red[::2, ::2] = 4095
    (folder := tmp_path / "bayer").mkdir()
    frame, _ = one_image(folder, ros, image(red, "bayer_rggb16"))
    np.testing.assert_array_equal(frame, np.broadcast_to([255, 0, 0], (48, 64, 3)))


@both_kinds
def test_an_image_that_is_not_read_is_named_and_costs_no_events(tmp_path, ros, capsys):
    depth = image(np.ones((48, 64), np.float32), "32FC1")
    events = some_events(30)
    CAMERA.save(tmp_path / "c.json")
    messages = [
        ("/d", IMAGE, START_US, START_US, depth),
        ("/e", ARRAY, START_US, START_US, array(ros, events)),
    ]
    path = bag(tmp_path, ros, messages)
    recording, notes = read(path)
    np.testing.assert_array_equal(recording.events, events)
    assert len(notes) == 1 and "left out /d (images encoded as 32FC1)" in notes[0]
    assert main.main(["info", str(path)]) == 0 and "32FC1" in capsys.readouterr().err
    (alone := tmp_path / "alone").mkdir()
    path = bag(alone, ros, [("/d", IMAGE, START_US, START_US, depth)])
    with pytest.raises(InputError, match=r"cannot read /d \(images encoded as 32FC1\); convert"):
        open_recording(path, CAMERA)


@both_kinds
@pytest.mark.parametrize(
    "first, encoding",
    [("/camera/depth/image", "16UC1"), ("/a", "16UC1"), ("/a", "32FC1"), ("/depth", "mono8")],
)
def test_depth_that_sorts_first_is_not_taken_for_an_image(tmp_path, ros, first, encoding):
    kind = {"16UC1": np.uint16, "32FC1": np.float32, "mono8": np.uint8}[encoding]
    messages = [(first, IMAGE, START_US, START_US, image(np.ones((48, 64), kind), encoding)),
                ("/dvs/image_raw", IMAGE, START_US, START_US, image(some_frame(), "rgb8"))]  # fmt: skip
    recording, notes = read(bag(tmp_path, ros, messages))
    np.testing.assert_array_equal(recording.frames[0], some_frame())
    assert len(notes) == 1 and f"taking /dvs/image_raw, not {first}" in notes[0]


@both_kinds
def test_a_compressed_image_of_12_bits(tmp_path, ros):
    deep = np.random.default_rng(0).integers(0, 4096, (48, 64), np.uint16)
    png = cv2.imencode(".png", deep)[1].ravel()
    fields = dict(format="mono16; png compressed ", data=png)
    message = "/i", "sensor_msgs/msg/CompressedImage", START_US, START_US, fields
    recording, notes = read(bag(tmp_path, ros, [message]))
    np.testing.assert_array_equal(recording.frames[0, ..., 0], deep >> 4)
    assert len(notes) == 1 and "take 12" in notes[0]


# --- times ----------------------------------------------------------------------------------------


def frames_at(stamps_us, recorded_us):
    both, fields = zip(stamps_us, recorded_us, strict=True), image(some_frame(), "rgb8")
    return [("/i", IMAGE, stamp_us, recorded_us, fields) for stamp_us, recorded_us in both]


@both_kinds
@pytest.mark.parametrize("count", [1, 2, 5])
def test_frames_without_stamps_have_the_times_of_the_recording(tmp_path, ros, count):
    recorded_us = [START_US + 33_000 * k for k in range(count)]
    recording, notes = read(bag(tmp_path, ros, frames_at([0] * count, recorded_us)))
    assert recording.frames_t_us.tolist() == recorded_us
    assert len(notes) == 1 and "times of /i are zero; taking the times at which it was recorded" in notes[0]


@both_kinds
def test_a_clock_that_begins_at_zero_is_no_missing_stamp(tmp_path, ros):
    stamps_us = [0, 50_000, 100_000]
    recording, notes = read(bag(tmp_path, ros, frames_at(stamps_us, [START_US + s for s in stamps_us])))
    assert recording.frames_t_us.tolist() == stamps_us and not notes


@both_kinds
@pytest.mark.parametrize("stamped", [False, True])
def test_events_without_times_have_those_of_their_messages(tmp_path, ros, stamped):
    events, times_us = some_events(40), [START_US, START_US + 7000]
    messages = []
    for part, t_us in zip(np.split(events, 2), times_us, strict=True):
        part["t_us"] = 0
        stamp_us, recorded_us = (t_us, t_us + 99_000) if stamped else (0, t_us)
        messages.append(("/e", ARRAY, stamp_us, recorded_us, array(ros, part)))
    recording, notes = read(bag(tmp_path, ros, messages))
    assert recording.events["t_us"].tolist() == np.repeat(times_us, 20).tolist()
    assert len(notes) == 1 and ("stamps of its messages" in notes[0]) == stamped


def libcaer(events, base_us):
    rows = [(x << 17 | y << 2 | int(p) << 1 | 1, (t - base_us) % 2**31) for t, x, y, p in events.tolist()]
    return b"".join(struct.pack("<II", *row) for row in rows)


def raw(encoder):
    """Words of a RAW file; its times are those of a sensor that began a minute before the first event."""

    def words(events, base_us):
        sensor = events.copy()
        sensor["t_us"] += 60_000_000 - START_US
        content = encoder(sensor)
        return content[content.index(b"end\n") + 4 :]

    return words


ENCODERS = {"mono": mono, "libcaer_cmp": libcaer_cmp, "libcaer": libcaer, "evt21": raw(prophesee.evt21),
            "evt3": raw(prophesee.evt3), "evt2": raw(prophesee.evt2)}  # fmt: skip


@both_kinds
@pytest.mark.parametrize("kind", packets.PACKETS)
@pytest.mark.parametrize("encoding", ENCODERS)
def test_packets_in_both_kinds_of_bags(tmp_path, ros, kind, encoding):
    events, messages = some_events(), []
    for part in np.split(events, [150, 300]):
        base_us = int(part["t_us"][0])
        fields = packet(encoding, ENCODERS[encoding](part, base_us), base_us)
        messages.append(("/e", kind, base_us, base_us, fields))
    recording, notes = read(bag(tmp_path, ros, messages))
    np.testing.assert_array_equal(recording.events, events)
    assert not notes


@both_kinds
@pytest.mark.parametrize("sensor_us", [0, 4_000_000, 99_000_000_000])
@pytest.mark.parametrize("encoding", ["mono", "libcaer_cmp", "libcaer"])
def test_a_base_of_the_sensors_clock_is_shifted_to_the_header(tmp_path, ros, sensor_us, encoding):
    """Once: what passes between two packets is the sensor's, however late the second header is."""
    events, messages = some_events(), []
    for late_us, part in zip((0, 900), np.split(events, 2), strict=True):
        base_us = int(part["t_us"][0])
        fields = packet(encoding, ENCODERS[encoding](part, base_us), base_us - START_US + sensor_us)
        messages.append(("/e", PACKET, base_us + late_us, base_us + late_us, fields))
    np.testing.assert_array_equal(read(bag(tmp_path, ros, messages))[0].events, events)


def test_the_time_of_libcaer_rolls_over_within_a_packet(tmp_path):
    events = some_events()
    fields = packet("libcaer", libcaer(events, START_US - 2**31 + 500_000), START_US - 2**31 + 500_000)
    path = bag(tmp_path, 2, [("/e", PACKET, START_US, START_US, fields)])
    np.testing.assert_array_equal(read(path)[0].events, events)
