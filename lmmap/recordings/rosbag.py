"""ROS 1 bags: event arrays and images, read from their packed bytes."""

from __future__ import annotations

import re
import struct
from contextlib import contextmanager
from functools import lru_cache, partial
from pathlib import Path

import cv2
import numpy as np
from rosbags.rosbag1 import ReaderError
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_typestore

from ..files import regular_file
from ..types import event_array
from . import bags
from .bounded_bag import BoundedReader
from .stream import input_errors

ERRORS = (ReaderError, SerdeError, TypesysError, AssertionError, LookupError, RuntimeError, cv2.error)
MAGIC = b"#ROSBAG V2.0\n"
STORE = get_typestore(Stores.ROS1_NOETIC)
EVENT_MSG = "uint16 x\nuint16 y\ntime ts\nbool polarity\n"
ARRAY_MSG = "std_msgs/Header header\nuint32 height\nuint32 width\ndvs_msgs/Event[] events\n"
PACKED = {"uint16": "<u2", "bool": "u1", "uint8": "u1", "time": [("s", "<u4"), ("ns", "<u4")]}


@contextmanager
def open_bag(path):
    """Open a bag; within the block, errors from damaged bytes become an `InputError` of one line."""
    path = Path(path)
    remedy = "give a whole ROS 1 bag with dvs_msgs or sensor_msgs: download it again, or run rosbag reindex"
    with input_errors(path, "cannot read this bag", remedy, ERRORS):
        regular_file(path)
        with path.open("rb") as file:
            if file.read(len(MAGIC)) != MAGIC:
                raise ValueError("not a ROS 1 bag, whatever its name says")
        with BoundedReader(path) as bag:
            yield bag


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


def _events(raw: bytes, definition: str) -> tuple[tuple[int, int], np.ndarray]:
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


ROS1 = bags.Dialect(
    open_bag,
    lambda: lambda _, connection, raw, header_us: _events(raw, connection.msgdef.data),
    lambda _, connection, raw: STORE.deserialize_ros1(raw, connection.msgtype),
    partial(struct.unpack_from, "<II", offset=4),
)
read = partial(bags.read, dialect=ROS1)
