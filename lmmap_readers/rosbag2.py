"""ROS 2 bags: folders with ``.db3`` or ``.mcap`` files, or one such file.

Events are read from dvs_msgs/EventArray and `packets`, images from sensor_msgs/Image and CompressedImage.
"""

from __future__ import annotations

import struct
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import apsw
import numpy as np
from rosbags.highlevel import AnyReaderError
from rosbags.rosbag2 import ReaderError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lmmap.recordings import bags, rosbag
from lmmap.recordings.stream import input_errors
from lmmap.types import event_array

from . import packets
from .bounded_bag2 import open_bag

ERRORS = (*rosbag.ERRORS, AnyReaderError, ReaderError, apsw.Error, TypeError, AttributeError)
STORE = get_typestore(Stores.ROS2_HUMBLE)  # for bags from before 2023, which state no types
EVENT_MSG = "uint16 x\nuint16 y\nbuiltin_interfaces/Time ts\nbool polarity\n"
for _name, _definition in (
    ("dvs_msgs/msg/Event", EVENT_MSG),
    ("dvs_msgs/msg/EventArray", rosbag.ARRAY_MSG),
    *((name, packets.DEFINITION) for name in packets.PACKETS),
):
    STORE.register(get_types_from_msg(_definition, _name))
# An event of an array: CDR aligns its time to 4 bytes, so that 13 bytes take 16, counted from 4 before them
RECORD = np.dtype({"names": ["x", "y", "s", "ns", "p"], "formats": ["<u2", "<u2", "<i4", "<u4", "u1"],
                   "offsets": [2, 4, 8, 12, 16], "itemsize": 17})  # fmt: skip
STRIDE = 16


@contextmanager
def _open(path: Path):
    remedy = "give a whole ROS 2 bag with events or images: copy it again, or run ros2 bag reindex"
    with input_errors(path, "cannot read this bag", remedy, ERRORS), open_bag(path, STORE) as bag:
        yield bag


def _size_px(raw: bytes) -> tuple[int, int]:
    """Width and height behind the header of an array or a packet, in little-endian CDR."""
    height, width = struct.unpack_from("<II", raw, _after_header(raw))
    return width, height


def _after_header(raw: bytes) -> int:
    """Where the bytes behind a std_msgs/Header begin: 4 of CDR, 8 of time, a text, then aligned to 4."""
    if raw[:2] != b"\0\1":
        raise ValueError("a message that is not in little-endian CDR")
    return -(-(16 + struct.unpack_from("<I", raw, 12)[0]) // 4) * 4


def _fields_of(bag, kind: str) -> list[str]:
    """Names of an event's fields, in their order."""
    event = kind.replace("EventArray", "Event")
    return [name for name, _ in bag.typestore.fielddefs[event][1]]


def _array_events(raw: bytes, fields: list[str]) -> np.ndarray:
    """Events of a message of dvs_msgs/EventArray."""
    if fields != ["x", "y", "ts", "polarity"]:
        raise ValueError(f"events of fields {', '.join(fields)}, expected x, y, ts, polarity")
    at = _after_header(raw) + 8
    (count,) = struct.unpack_from("<I", raw, at)
    if not count:
        return event_array([], [], [], [])
    if at + STRIDE * count + 1 > len(raw):
        raise ValueError(f"an event array of {len(raw)} bytes for {count} events")
    e = np.ndarray(count, RECORD, raw, at, (STRIDE,))
    x, y = e["x"].copy(), e["y"].copy()
    x[0], y[0] = struct.unpack_from("<HH", raw, at + 4)  # the first is aligned already
    return event_array(
        e["s"].astype(np.int64) * 10**6 + (e["ns"].astype(np.int64) + 500) // 1000, x, y, e["p"]
    )


def _arrays(bag, connection, raw: bytes, header_us: int) -> tuple[tuple[int, int], np.ndarray]:
    return _size_px(raw), _array_events(raw, _fields_of(bag, connection.msgtype))


def _deserialize(bag, connection, raw: bytes):
    return bag.deserialize(raw, connection.msgtype)


ROS2 = bags.Dialect(
    _open,
    packets.decoder(_arrays, _deserialize),
    _deserialize,
    lambda raw: struct.unpack_from("<iI" if raw[1] & 1 else ">iI", raw, 4),
    packets.PACKETS,
)
read = partial(bags.read, dialect=ROS2)
read.what = "ROS 2 bag, a folder or a file: the same"
