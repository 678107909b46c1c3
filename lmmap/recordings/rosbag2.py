"""ROS 2 bags: folders with ``.db3`` or ``.mcap`` files, or one such file.

Events are read from dvs_msgs/EventArray, or from event_camera_msgs/EventPacket as evt3, libcaer_cmp or mono;
images from sensor_msgs/Image and CompressedImage.
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

from ..types import event_array
from . import bags, evt, rosbag
from .bounded_bag2 import open_bag
from .stream import input_errors

ERRORS = (*rosbag.ERRORS, AnyReaderError, ReaderError, apsw.Error, TypeError, AttributeError)
STORE = get_typestore(Stores.ROS2_HUMBLE)  # for bags from before 2023, which state no types
PACKET_MSG = """std_msgs/Header header
uint32 height
uint32 width
uint64 seq
uint64 time_base
string encoding
bool is_bigendian
uint8[] events
"""
EVENT_MSG = "uint16 x\nuint16 y\nbuiltin_interfaces/Time ts\nbool polarity\n"
for _name, _definition in (
    ("dvs_msgs/msg/Event", EVENT_MSG),
    ("dvs_msgs/msg/EventArray", rosbag.ARRAY_MSG),
    ("event_camera_msgs/msg/EventPacket", PACKET_MSG),
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


class Decoder:
    """Events of arrays, and of packets of event_camera_msgs in their order.

    Times of libcaer_cmp and mono are ROS times.  Those of evt3 are the sensor's: they are shifted so that
    the first packet begins at its header's stamp.
    """

    def __init__(self):
        self.evt3, self.libcaer, self.shift_us = evt.Evt3(), evt.Evt3(evt.LIBCAER_CMP), None

    def __call__(self, bag, connection, raw: bytes) -> tuple[tuple[int, int], np.ndarray]:
        """Size and events of one message."""
        size_px = _size_px(raw)
        if connection.msgtype.endswith("/EventArray"):
            return size_px, _array_events(raw, _fields_of(bag, connection.msgtype))
        return size_px, self._packet_events(bag.deserialize(raw, connection.msgtype))

    def _packet_events(self, message) -> np.ndarray:
        if message.is_bigendian:
            raise ValueError("event packets in big-endian order")
        packed = np.asarray(message.events, np.uint8)
        base_us = (message.time_base + 500) // 1000
        if message.encoding == "evt3":
            events = self.evt3.events(_words(packed, self.evt3.word))
            if self.shift_us is None and len(events):
                self.shift_us = bags.time_us(message.header.stamp) - int(events["t_us"][0])
            base_us = self.shift_us or 0
        elif message.encoding == "libcaer_cmp":
            self.libcaer.start_at_zero()
            events = self.libcaer.events(_words(packed, self.libcaer.word))
        elif message.encoding == "mono":
            events, base_us = evt.mono(_words(packed, evt.MONO), message.time_base), 0
        else:
            raise ValueError(f"event packets encoded as {message.encoding}, expected evt3, libcaer_cmp, mono")
        events["t_us"] += base_us
        return events


def _words(packed: np.ndarray, word: np.dtype) -> np.ndarray:
    if len(packed) % word.itemsize:
        raise ValueError(f"an event packet of {len(packed)} bytes, expected a multiple of {word.itemsize}")
    return packed.view(word)


ROS2 = bags.Dialect(
    _open,
    ("/EventArray", "/EventPacket"),
    Decoder,
    lambda bag, connection, raw: bag.deserialize(raw, connection.msgtype),
)
read = partial(bags.read, dialect=ROS2)
