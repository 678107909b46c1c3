"""ROS 1 bags: event arrays and images, read from their packed bytes, and written."""

from __future__ import annotations

import re
import struct
import warnings
from pathlib import Path

import cv2
import numpy as np
from rosbags.rosbag1 import Reader, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from .core import Camera, InputError, Recording
from .events import from_columns

EVENT_MSG = "uint16 x\nuint16 y\ntime ts\nbool polarity\n"
ARRAY_MSG = "std_msgs/Header header\nuint32 height\nuint32 width\ndvs_msgs/Event[] events\n"
PACKED = {"uint16": "<u2", "bool": "u1", "uint8": "u1", "time": [("s", "<u4"), ("ns", "<u4")]}
IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
TO_RGB = {
    "mono8": cv2.COLOR_GRAY2RGB, "8UC1": cv2.COLOR_GRAY2RGB,
    "bgr8": cv2.COLOR_BGR2RGB, "8UC3": cv2.COLOR_BGR2RGB,
    "rgb8": None, "rgba8": cv2.COLOR_RGBA2RGB, "bgra8": cv2.COLOR_BGRA2RGB,
    "bayer_rggb8": cv2.COLOR_BayerRGGB2RGB, "bayer_bggr8": cv2.COLOR_BayerBGGR2RGB,
    "bayer_grbg8": cv2.COLOR_BayerGRBG2RGB, "bayer_gbrg8": cv2.COLOR_BayerGBRG2RGB,
}  # fmt: skip


def read(path: Path):
    """Events, frames, their times and the size_px of the first topic of each kind; raises `InputError`."""
    store = get_typestore(Stores.ROS1_NOETIC)
    events, frames, t_us, sizes = [], [], [], set()
    try:
        with Reader(path) as bag:
            arrays = _topic(bag, path, lambda kind: kind.endswith("/EventArray"))
            images = _topic(bag, path, IMAGES.__contains__)
            for connection, _, raw in bag.messages(arrays + images):
                if connection in arrays:
                    size_px, batch = _events(raw, connection.msgdef.data)
                    events.append(batch)
                else:
                    message = store.deserialize_ros1(raw, connection.msgtype)
                    stamp = message.header.stamp
                    t_us.append(stamp.sec * 10**6 + round(stamp.nanosec / 1000))
                    frames.append(_rgb(message))
                    size_px = frames[-1].shape[1::-1]
                sizes.add(tuple(size_px))
        if len(sizes) != 1:
            raise ValueError(f"expected events or images of one size, found {sorted(sizes)}")
    except Exception as error:  # the library raises a dozen types on damaged bytes
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        remedy = "give a ROS 1 bag with dvs_msgs or sensor_msgs, or run rosbag reindex"
        raise InputError(f"{path}: cannot read this bag ({reason}); {remedy}") from None
    (size_px,) = sizes
    none = from_columns([], [], [], [])
    return (
        np.concatenate([none, *events]),
        np.array(frames) if frames else None,
        np.array(t_us, np.int64),
        size_px,
    )


def _topic(bag: Reader, path: Path, wanted) -> list:
    found = sorted((c for c in bag.connections if wanted(c.msgtype)), key=lambda c: c.topic)
    if skipped := sorted({c.topic for c in found} - {c.topic for c in found[:1]}):
        warnings.warn(f"{path}: taking {found[0].topic}, not {', '.join(skipped)}", stacklevel=4)
    return [c for c in found if c.topic == found[0].topic]


def _events(raw: bytes, definition: str):
    """Size and events of one message, whichever order of fields its definition in the bag states."""
    whole, _, parts = definition.partition("\n===")
    part = next(p for p in parts.split("\n===") if re.search(r"MSG: *\S+/Event\s", p))
    head, fields = _fields(whole), _fields(part)
    names = [name for _, name in head]
    if sorted(names[1:3]) != ["height", "width"] or names[0] != "header" or names[3:] != ["events"]:
        raise ValueError(f"an event array of fields {names}")
    record = np.dtype([(name, PACKED[kind]) for kind, name in fields])
    at = 16 + struct.unpack_from("<I", raw, 12)[0]  # sequence, seconds, nanoseconds, name of the frame
    first, second, count = struct.unpack_from("<III", raw, at)
    if len(raw) != at + 12 + count * record.itemsize:
        raise ValueError(f"an event array of {len(raw)} bytes for {count} events")
    e = np.frombuffer(raw, record, count, at + 12)
    t_us = e["ts"]["s"].astype(np.int64) * 10**6 + (e["ts"]["ns"].astype(np.int64) + 500) // 1000
    size = {names[1]: first, names[2]: second}
    return (size["width"], size["height"]), from_columns(t_us, e["x"], e["y"], e["polarity"])


def _fields(definition: str) -> list[tuple[str, str]]:
    lines = (line.split("#")[0].split() for line in definition.splitlines())
    return [
        (line[0], line[1]) for line in lines if len(line) == 2 and "=" not in line[0] and line[0] != "MSG:"
    ]


def _rgb(message) -> np.ndarray:
    if hasattr(message, "format"):
        bgr = cv2.imdecode(message.data, cv2.IMREAD_COLOR)
        if bgr is None:
            raise ValueError("a compressed image that does not decode")
        return cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB)
    if message.encoding not in TO_RGB:
        raise ValueError(f"images encoded as {message.encoding}")
    rows = np.asarray(message.data).reshape(message.height, message.step)
    depth = {"rgba8": 4, "bgra8": 4, "rgb8": 3, "bgr8": 3, "8UC3": 3}.get(message.encoding, 1)
    pixels = np.ascontiguousarray(rows[:, : message.width * depth]).reshape(
        message.height, message.width, depth
    )
    code = TO_RGB[message.encoding]
    return pixels if code is None else cv2.cvtColor(pixels, code)


def write(recording: Recording, path: Path) -> None:
    """Write ``/dvs/events``, ``/dvs/image_raw`` and, with each image, ``/dvs/camera_info``.

    Raises `OSError`, and ValueError for negative times.
    """
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg(EVENT_MSG, "dvs_msgs/msg/Event"))
    store.register(get_types_from_msg(ARRAY_MSG, "dvs_msgs/msg/EventArray"))
    width, height = recording.camera.size_px
    record = np.dtype([("x", "<u2"), ("y", "<u2"), ("s", "<u4"), ("ns", "<u4"), ("p", "u1")])
    with Writer(path) as bag:
        events = bag.add_connection("/dvs/events", "dvs_msgs/msg/EventArray", typestore=store)
        images = bag.add_connection("/dvs/image_raw", IMAGES[0], typestore=store)
        cameras = bag.add_connection("/dvs/camera_info", "sensor_msgs/msg/CameraInfo", typestore=store)
        calibration = _camera_info(recording.camera)
        for start in range(0, max(1, len(recording.events)), 100_000):
            e = recording.events[start : start + 100_000]
            packed = np.zeros(len(e), record)
            packed["x"], packed["y"], packed["p"] = e["x"], e["y"], e["p"]
            packed["s"], packed["ns"] = e["t_us"] // 10**6, e["t_us"] % 10**6 * 1000
            t_us = int(e["t_us"][-1]) if len(e) else 0
            body = struct.pack("<III", height, width, len(e)) + packed.tobytes()
            bag.write(events, t_us * 1000, _header(t_us) + body)
        form = struct.pack("<II", height, width) + struct.pack("<I", 4) + b"rgb8"
        form += struct.pack("<BII", 0, 3 * width, 3 * width * height)
        for t_us, frame in zip(recording.frames_t_us.tolist(), recording.frames, strict=True):
            bag.write(images, t_us * 1000, _header(t_us) + form + np.ascontiguousarray(frame).tobytes())
            bag.write(cameras, t_us * 1000, _header(t_us) + calibration)


def _header(t_us: int) -> bytes:
    if t_us < 0:
        raise ValueError("bag: times must not be negative")
    return struct.pack("<IIII", 0, t_us // 10**6, t_us % 10**6 * 1000, 0)


def _camera_info(camera: Camera) -> bytes:
    """A sensor_msgs/CameraInfo behind its header; k1, k2, p1, p2, k3 are the plumb_bob model's."""
    D = np.zeros(5)
    D[: len(camera.distortion)] = camera.distortion
    P = np.column_stack([camera.K, np.zeros(3)])
    model = b"plumb_bob"
    body = struct.pack(f"<III{len(model)}sI", camera.height_px, camera.width_px, len(model), model, len(D))
    body += np.concatenate([D, camera.K.ravel(), np.eye(3).ravel(), P.ravel()]).astype("<f8").tobytes()
    return body + bytes(4 + 4 + 17)  # no binning, no region of interest
