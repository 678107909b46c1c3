"""ROS 1 bags: event arrays and images, read from their packed bytes."""

from __future__ import annotations

import re
import struct
import warnings
from contextlib import contextmanager
from functools import lru_cache, partial
from pathlib import Path

import cv2
import numpy as np
from rosbags.rosbag1 import Reader, ReaderError
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

from ..files import regular_file
from ..types import event_array
from .bounded_bag import BoundedReader
from .images import decode
from .limits import check_image
from .stream import Source, in_chunks, input_errors

ERRORS = (ReaderError, SerdeError, TypesysError, AssertionError, LookupError, RuntimeError, cv2.error)
MAGIC = b"#ROSBAG V2.0\n"
STORE = get_typestore(Stores.ROS1_NOETIC)
EVENT_MSG = "uint16 x\nuint16 y\ntime ts\nbool polarity\n"
ARRAY_MSG = "std_msgs/Header header\nuint32 height\nuint32 width\ndvs_msgs/Event[] events\n"
for _name, _definition in (
    ("dvs_msgs/msg/Event", EVENT_MSG),
    ("dvs_msgs/msg/EventArray", ARRAY_MSG),
    ("tf2_msgs/msg/TFMessage", "geometry_msgs/TransformStamped[] transforms\n"),
):
    STORE.register(get_types_from_msg(_definition, _name))
PACKED = {"uint16": "<u2", "bool": "u1", "uint8": "u1", "time": [("s", "<u4"), ("ns", "<u4")]}
IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
TO_RGB = {
    "mono8": cv2.COLOR_GRAY2RGB, "8UC1": cv2.COLOR_GRAY2RGB,
    "bgr8": cv2.COLOR_BGR2RGB, "8UC3": cv2.COLOR_BGR2RGB,
    "rgb8": None, "rgba8": cv2.COLOR_RGBA2RGB, "bgra8": cv2.COLOR_BGRA2RGB,
    "bayer_rggb8": cv2.COLOR_BayerRGGB2RGB, "bayer_bggr8": cv2.COLOR_BayerBGGR2RGB,
    "bayer_grbg8": cv2.COLOR_BayerGRBG2RGB, "bayer_gbrg8": cv2.COLOR_BayerGBRG2RGB,
}  # fmt: skip


def read(path: Path) -> Source:
    """The first topic of each kind; raises `InputError`."""
    with open_bag(path) as bag:
        arrays = first_topic(bag, path, _is_events)
        images = first_topic(bag, path, IMAGES.__contains__)
        if not arrays and not images:
            raise ValueError(f"no dvs_msgs/EventArray and no image in {len(bag.topics)} topics")
        arrays, images = (topic if any(c.msgcount for c in topic) else [] for topic in (arrays, images))
        first = next(bag.messages(arrays or images), None) if arrays or images else None
        if first is None:
            raise ValueError("no message in its topics")
        connection, _, raw = first
        size_px = (
            _events(raw, connection.msgdef.data)[0] if arrays else _image(raw, connection)[1].shape[1::-1]
        )
        span_us = bag.start_time // 1000, bag.end_time // 1000
        details = partial(dict, topics=topics_of(bag))
    return Source(
        path, tuple(size_px), partial(_chunks, path, tuple(size_px)), partial(_frames, path), span_us, details
    )


def _chunks(path: Path, size_px: tuple[int, int]):
    def batches(bag):
        for connection, _, raw in _messages(bag, path, _is_events):
            size, batch = _events(raw, connection.msgdef.data)
            if size != size_px:
                raise ValueError(f"event arrays for {size} px among those for {size_px} px")
            yield batch

    with open_bag(path) as bag:
        yield from in_chunks(batches(bag))


def _frames(path: Path):
    with open_bag(path) as bag:
        for connection, _, raw in _messages(bag, path, IMAGES.__contains__):
            yield _image(raw, connection)


def _messages(bag: Reader, path: Path, wanted):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # said when the file was opened
        connections = first_topic(bag, path, wanted)
    return bag.messages(connections) if connections else iter(())  # of no connection means of all


def _is_events(kind: str) -> bool:
    return kind.endswith("/EventArray")


def _image(raw: bytes, connection) -> tuple[int, np.ndarray]:
    message = STORE.deserialize_ros1(raw, connection.msgtype)
    stamp = message.header.stamp
    return stamp.sec * 10**6 + (stamp.nanosec + 500) // 1000, rgb(message)


@contextmanager
def open_bag(path):
    """A bag's reader; within its block, what damaged bytes raise becomes one `InputError` line."""
    path = Path(path)
    with _file_errors(path):
        regular_file(path)
        with path.open("rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise ValueError("not a ROS 1 bag, whatever its name says")
        with BoundedReader(path) as bag:
            yield bag


def _file_errors(path: Path):
    remedy = "give a whole ROS 1 bag with dvs_msgs or sensor_msgs: download it again, or run rosbag reindex"
    return input_errors(path, "cannot read this bag", remedy, ERRORS)


def first_topic(bag: Reader, path: Path, wanted) -> list:
    """Connections of the first topic whose type is ``wanted``; a warning names the others."""
    connections = sorted((c for c in bag.connections if wanted(c.msgtype)), key=lambda c: c.topic)
    if skipped := sorted({c.topic for c in connections} - {c.topic for c in connections[:1]}):
        warnings.warn(f"{path}: taking {connections[0].topic}, not {', '.join(skipped)}", stacklevel=4)
    return [c for c in connections if c.topic == connections[0].topic]


def topics_of(bag: Reader) -> list[str]:
    """Each topic with its type and its number of messages."""
    topics = sorted(bag.topics.items())
    return [f"{name} ({topic.msgtype or 'several types'}, {topic.msgcount})" for name, topic in topics]


@lru_cache
def _layout(definition: str) -> tuple[list[str], np.dtype]:
    """Names of an array's fields and the packed record of an event, whichever order its definition states."""
    whole, _, parts = definition.partition("\n===")
    part = next((p for p in parts.split("\n===") if re.search(r"MSG: *\S+/Event\s", p)), "")
    head, fields = _fields(whole), _fields(part)
    names = [name for _, name in head]
    if sorted(names[1:3]) != ["height", "width"] or names[0] != "header" or names[3:] != ["events"]:
        raise ValueError(f"an event array of fields {names}")
    return names, np.dtype([({"p": "polarity"}.get(name, name), PACKED[kind]) for kind, name in fields])


def _events(raw: bytes, definition: str):
    """Size and events of one message."""
    names, record = _layout(definition)
    at = 16 + struct.unpack_from("<I", raw, 12)[0]  # sequence, seconds, nanoseconds, name of the frame
    first, second, count = struct.unpack_from("<III", raw, at)
    if len(raw) != at + 12 + count * record.itemsize:
        raise ValueError(f"an event array of {len(raw)} bytes for {count} events")
    e = np.frombuffer(raw, record, count, at + 12)
    # (ns // 500 + 1) // 2 is (ns + 500) // 1000, but does not overflow; 64 bit would take twice as long
    t_us = e["ts"]["s"].astype(np.int64) * 10**6 + (e["ts"]["ns"] // 500 + 1) // 2
    size = {names[1]: first, names[2]: second}
    return (size["width"], size["height"]), event_array(t_us, e["x"], e["y"], e["polarity"])


def _fields(definition: str) -> list[tuple[str, str]]:
    lines = (line.split("#")[0].split() for line in definition.splitlines())
    return [
        (line[0], line[1]) for line in lines if len(line) == 2 and "=" not in line[0] and line[0] != "MSG:"
    ]


def rgb(message) -> np.ndarray:
    if hasattr(message, "format"):
        return decode(bytes(message.data))
    if message.encoding not in TO_RGB:
        raise ValueError(f"images encoded as {message.encoding}")
    check_image(message.width, message.height)
    rows = np.asarray(message.data).reshape(message.height, message.step)
    depth = {"rgba8": 4, "bgra8": 4, "rgb8": 3, "bgr8": 3, "8UC3": 3}.get(message.encoding, 1)
    pixels = np.ascontiguousarray(rows[:, : message.width * depth]).reshape(
        message.height, message.width, depth
    )
    code = TO_RGB[message.encoding]
    return pixels if code is None else cv2.cvtColor(pixels, code)
