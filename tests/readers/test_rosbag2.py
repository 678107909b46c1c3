"""Laws of ROS 2 bags: events and images as the messages state them, in both storages, or one clear line."""

import struct

import apsw
import cv2
import numpy as np
import pytest
from foreign_files import KINDS, STORE, array, bag, header, image, packet
from rosbags.rosbag2 import CompressionMode, StoragePlugin, Writer

from lmmap.cli import main
from lmmap.recordings.formats import open_recording, open_stream
from lmmap.recordings.limits import MAX_CHUNK_BYTES
from lmmap.types import EVENT, Camera, InputError
from lmmap_readers import bounded_bag2

CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5)
START_US = 1_600_000_000_123_456


def some_events(count=400, first_us=START_US):
    rng = np.random.default_rng(0)
    e = np.zeros(count, EVENT)
    e["t_us"] = first_us + np.sort(rng.integers(0, 2_000_000, count))
    e["t_us"][0] = first_us
    e["x"], e["y"], e["p"] = rng.integers(0, 64, count), rng.integers(0, 48, count), rng.random(count) < 0.5
    return e


def mono(events, base_us):
    return b"".join(
        struct.pack("<IHH", (t - base_us) * 1000, x, int(p) << 15 | y) for t, x, y, p in events.tolist()
    )


def libcaer_cmp(events, base_us):
    """Times and x before each event; the last two as a vector where they share a column."""
    words = []
    for t, x, y, p in events.tolist():
        high, low = divmod(t - base_us, 4096)
        words += [high, 1 << 12 | low, 2 << 12 | x, 3 << 12 | int(p) << 11 | y]
    return struct.pack(f"<{len(words)}H", *words)


def evt3(events, base_us):
    words = []
    for t, x, y, p in events.tolist():
        high, low = divmod(t - base_us, 4096)
        words += [8 << 12 | high, 6 << 12 | low, y, 2 << 12 | int(p) << 11 | x]
    return struct.pack(f"<{len(words)}H", *words)


def some_frame():
    return np.random.default_rng(1).integers(0, 256, (48, 64, 3), np.uint8)


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize("frame", ["", "cam", "camera", "camera_optical"])
def test_event_arrays_and_images(tmp_path, storage, frame):
    """However long the name of the frame is, and so whatever is aligned behind it."""
    events, picture = some_events(), some_frame()
    messages = [("/e", array(events[i : i + 150], frame), START_US + i) for i in range(0, len(events), 150)]
    messages += [("/e", array(events[:0], frame), START_US + 500), ("/i", image(picture, START_US), START_US)]
    path = bag(tmp_path / "b", messages, storage)
    back = open_recording(path, CAMERA)
    np.testing.assert_array_equal(back.events, events)
    np.testing.assert_array_equal(back.frames, picture[None])
    assert back.frames_t_us.tolist() == [START_US]
    (file,) = [p for p in path.iterdir() if p.suffix in (".mcap", ".db3")]
    np.testing.assert_array_equal(open_recording(file, CAMERA).events, events)
    assert open_stream(path, CAMERA).source.size_px == (64, 48)


@pytest.mark.parametrize("encoding, encoder", [("mono", mono), ("libcaer_cmp", libcaer_cmp), ("evt3", evt3)])
def test_event_packets(tmp_path, encoding, encoder):
    """Times of mono and libcaer_cmp count from each packet's base; those of evt3 from the sensor's start,
    and are moved to where the first header's stamp is."""
    events, messages = some_events(), []
    for i in range(0, len(events), 150):
        part = events[i : i + 150]
        base_us = START_US - 777 if encoding == "evt3" else int(part["t_us"][0])
        time_base = 0 if encoding == "evt3" else base_us * 1000
        t_us = int(part["t_us"][0])
        messages.append(("/e", packet(encoding, encoder(part, base_us), t_us, time_base), t_us))
    np.testing.assert_array_equal(open_recording(bag(tmp_path / "b", messages), CAMERA).events, events)


def test_vectors_of_libcaer_cmp_by_hand(tmp_path):
    """High time 1, low time 2, x 9; ON from y 16: bits 0 and 7, then bit 1 of the next 8."""
    packed = struct.pack("<6H", 0x0001, 0x1002, 0x2009, 0x4810, 0x5081, 0x5002)
    path = bag(tmp_path / "b", [("/e", packet("libcaer_cmp", packed, START_US, START_US * 1000), START_US)])
    t_us = START_US + 4098
    expected = np.array([(t_us, 9, 16, True), (t_us, 9, 23, True), (t_us, 9, 25, True)], EVENT)
    np.testing.assert_array_equal(open_recording(path, CAMERA).events, expected)


@pytest.mark.parametrize("encoding", ["rgb8", "bgr8", "mono8", "rgba8"])
def test_encodings_of_images(tmp_path, encoding):
    picture = some_frame()
    raw = {
        "rgb8": picture,
        "bgr8": np.ascontiguousarray(picture[..., ::-1]),
        "mono8": np.ascontiguousarray(picture[..., 0]),
        "rgba8": np.dstack([picture, np.full((48, 64), 255, np.uint8)]),
    }[encoding]
    back = open_recording(bag(tmp_path / "b", [("/i", image(raw, START_US, encoding), START_US)]), CAMERA)
    expected = np.repeat(picture[..., :1], 3, -1) if encoding == "mono8" else picture
    np.testing.assert_array_equal(back.frames, expected[None])


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize("mode", [CompressionMode.FILE, CompressionMode.MESSAGE])
def test_compressed_bags(tmp_path, storage, mode):
    events, picture = some_events(), some_frame()
    messages = [("/e", array(events), START_US), ("/i", image(picture, START_US), START_US)]
    back = open_recording(bag(tmp_path / "b", messages, storage, mode), CAMERA)
    np.testing.assert_array_equal(back.events, events)
    np.testing.assert_array_equal(back.frames, picture[None])


def test_compressed_images(tmp_path):
    picture = some_frame()
    _, png = cv2.imencode(".png", picture[..., ::-1])
    message = KINDS["sensor_msgs/msg/CompressedImage"](
        header=header(START_US), format="png", data=png.ravel()
    )
    back = open_recording(bag(tmp_path / "b", [("/i", message, START_US)]), CAMERA)
    np.testing.assert_array_equal(back.frames, picture[None])


@pytest.mark.parametrize(
    "message, problem",
    [
        (packet("evt9", b"", START_US), "encoded as evt9, expected evt3"),
        (packet("evt3", b"123", START_US), "3 bytes, expected a multiple of 2"),
        (packet("mono", b"123456789", START_US), "9 bytes, expected a multiple of 8"),
        (packet("mono", b"", START_US, is_bigendian=True), "big-endian"),
        (KINDS["std_msgs/msg/String"]("hello"), "no EventArray, EventPacket or image in 1 topics"),
    ],
)
def test_messages_that_are_not_understood(tmp_path, message, problem, capsys):
    Camera.save(CAMERA, tmp_path / "c.json")
    path = bag(tmp_path / "b", [("/e", message, START_US)])
    assert main.main(["info", str(path), "--camera", str(tmp_path / "c.json")]) == 1
    err = capsys.readouterr().err
    assert len(err.splitlines()) == 1 and problem in err


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_cut_or_damaged_bag_is_one_line(tmp_path, storage):
    """At twenty places: cut there, and a run of bytes replaced there."""
    events = some_events(2000)
    messages = [("/e", array(events[i : i + 100]), START_US + i) for i in range(0, len(events), 100)]
    path = bag(tmp_path / "b", [*messages, ("/i", image(some_frame(), START_US), START_US)], storage)
    (file,) = [p for p in path.iterdir() if p.suffix in (".mcap", ".db3")]
    whole, rng, damaged = file.read_bytes(), np.random.default_rng(2), 0
    for k in range(20):
        at = k * len(whole) // 20
        for content in (whole[:at], whole[:at] + rng.bytes(300) + whole[at + 300 :]):
            file.write_bytes(content)
            for name in (path, file):
                try:
                    open_recording(name, CAMERA)
                except InputError as error:
                    damaged += 1
                    assert "\n" not in str(error) and str(error).startswith(f"{name}: ")
                else:
                    assert len(content) == len(whole)
    assert damaged >= 40


def test_what_was_read_before_the_damage_is_kept(tmp_path):
    events = some_events()
    good = packet("mono", mono(events, START_US), START_US, START_US * 1000)
    bad = packet("mono", b"1", int(events["t_us"][-1]))
    path = bag(tmp_path / "b", [("/e", good, START_US), ("/e", bad, START_US + 1)])
    chunks = open_stream(path, CAMERA).chunks()
    np.testing.assert_array_equal(next(chunks), events)
    with pytest.raises(InputError, match="1 bytes, expected a multiple of 8"):
        next(chunks)


def test_absurd_counts_and_wrong_magic(tmp_path):
    raw = bytearray(STORE.serialize_cdr(array(some_events(3)), "dvs_msgs/msg/EventArray"))
    assert raw[24:36] == struct.pack(
        "<III", 48, 64, 3
    )  # behind a header of 4 + 8 + 4 + 7 bytes, aligned to 4
    raw[32:36] = b"\xff\xff\xff\x7f"
    with Writer(tmp_path / "b", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/e", "dvs_msgs/msg/EventArray", typestore=STORE)
        writer.write(connection, START_US * 1000, bytes(raw))
    with pytest.raises(InputError, match="bytes for 2147483647 events"):
        open_recording(tmp_path / "b", CAMERA)
    for name in ("e.mcap", "e.db3"):
        (tmp_path / name).write_bytes(b"no bag" * 100)
        with pytest.raises(InputError, match=rf"e\.{name[2:]}: cannot read this bag"):
            open_recording(tmp_path / name, CAMERA)


def test_time_that_runs_back_is_an_error(tmp_path):
    events = some_events()
    messages = [("/e", array(events[200:]), START_US), ("/e", array(events[:200]), START_US + 1)]
    with pytest.raises(InputError, match="runs backward"):
        open_recording(bag(tmp_path / "b", messages), CAMERA)


@pytest.mark.parametrize("mode", ["wal", "persist"])
def test_messages_that_lie_beside_a_database_are_not_left_out(tmp_path, mode):
    """As a recorder leaves them that was killed; a log that is empty is none."""
    path = bag(tmp_path / "b", [("/i", image(some_frame(), START_US), START_US)], StoragePlugin.SQLITE3)
    (file,) = path.glob("*.db3")
    log = file.with_name(file.name + {"wal": "-wal", "persist": "-journal"}[mode])
    log.touch()
    assert len(open_recording(file, CAMERA).frames) == 1
    log.write_bytes(bytes(100))
    for name in (file, path):
        with pytest.raises(
            InputError, match=rf"its last messages lie in {log.name} .*sqlite3 {file.name} vacuum"
        ):
            open_recording(name, CAMERA)


def test_a_database_s_name_is_no_address(tmp_path):
    path = bag(tmp_path / "b", [("/i", image(some_frame(), START_US), START_US)], StoragePlugin.SQLITE3)
    (file,) = path.glob("*.db3")
    odd = file.rename(tmp_path / "50%23 left #1 a?b.db3")
    assert len(open_recording(odd, CAMERA).frames) == 1


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_bag_s_folder_without_its_description(tmp_path, storage):
    path = bag(tmp_path / "b", [("/i", image(some_frame(), START_US), START_US)], storage)
    (path / "metadata.yaml").unlink()
    with pytest.raises(
        InputError, match=r"b: a folder of 1 recordings, .*metadata\.yaml is missing: run ros2 bag"
    ):
        open_recording(path, CAMERA)


def test_reading_bags_changes_the_libraries_for_nobody_else():
    """The table of the library's decompressors, its database's limits, and hooks for all connections."""
    from rosbags.rosbag2 import storage_mcap, storage_sqlite3

    assert all(f.__module__ == storage_mcap.__name__ for f in storage_mcap.DECOMPRESSORS.values())
    assert not apsw.connection_hooks and storage_sqlite3.apsw is apsw
    assert apsw.Connection(":memory:").limit(apsw.SQLITE_LIMIT_LENGTH) > MAX_CHUNK_BYTES
    assert bounded_bag2.BoundedMcap.__mro__[1] is not storage_mcap.McapReader
