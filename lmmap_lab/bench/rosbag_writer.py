"""ROS 1 bags, written: event arrays, images and the camera's calibration."""

from __future__ import annotations

import struct
from heapq import merge
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lmmap.recordings.bags import IMAGES
from lmmap.recordings.rosbag import ARRAY_MSG, EVENT_MSG
from lmmap.recordings.stream import pieces
from lmmap.types import Camera, InputError, Recording

STORE = get_typestore(Stores.ROS1_NOETIC)
for _name, _definition in (
    ("dvs_msgs/msg/Event", EVENT_MSG),
    ("dvs_msgs/msg/EventArray", ARRAY_MSG),
    ("tf2_msgs/msg/TFMessage", "geometry_msgs/TransformStamped[] transforms\n"),
):
    STORE.register(get_types_from_msg(_definition, _name))
PER_MESSAGE = 10_000  # events, as a DAVIS driver at its default rate


def write(recording: Recording, path: Path, others=(), calibrated: bool = True) -> None:
    """Write ``/dvs/events``, ``/dvs/image_raw`` and, if ``calibrated``, ``/dvs/camera_info`` with each image.

    ``others`` are further topics: ``(topic, type, messages)`` with messages ``(t_us, bytes)`` in the order
    of time.  All are interleaved by time.  Raises `OSError`, and ValueError for negative times.
    """
    topics = [("/dvs/events", "dvs_msgs/msg/EventArray", _event_messages(recording)),
              ("/dvs/image_raw", IMAGES[0], _image_messages(recording)), *others]  # fmt: skip
    if calibrated:
        info = _camera_info(recording.camera)
        messages = ((t_us, header(t_us) + info) for t_us, _ in recording.timed_frames())
        topics.append(("/dvs/camera_info", "sensor_msgs/msg/CameraInfo", messages))
    with Writer(path) as bag:
        connections = [bag.add_connection(topic, kind, typestore=STORE) for topic, kind, _ in topics]
        numbered = (_number_messages(k, messages) for k, (_, _, messages) in enumerate(topics))
        ordered = merge(*numbered, key=lambda m: m[0])
        for t_us, k, raw in ordered:
            bag.write(connections[k], t_us * 1000, raw)


def _number_messages(number: int, messages):
    return ((t_us, number, raw) for t_us, raw in messages)


def _event_messages(recording: Recording):
    width, height = recording.camera.size_px
    record = np.dtype([("x", "<u2"), ("y", "<u2"), ("s", "<u4"), ("ns", "<u4"), ("p", "u1")])
    for chunk in recording.chunks():
        for e in pieces(chunk, PER_MESSAGE):
            packed = np.zeros(len(e), record)
            packed["x"], packed["y"], packed["p"] = e["x"], e["y"], e["p"]
            packed["s"], packed["ns"] = e["t_us"] // 10**6, e["t_us"] % 10**6 * 1000
            t_us = int(e["t_us"][-1])
            yield t_us, header(t_us) + struct.pack("<III", height, width, len(e)) + packed.tobytes()


def _image_messages(recording: Recording):
    width, height = recording.camera.size_px
    form = struct.pack("<II", height, width) + struct.pack("<I", 4) + b"rgb8"
    form += struct.pack("<BII", 0, 3 * width, 3 * width * height)
    for t_us, frame in recording.timed_frames():
        yield int(t_us), header(t_us) + form + np.ascontiguousarray(frame).tobytes()


def header(t_us: int, frame: str = "") -> bytes:
    """A std_msgs/Header; `InputError` for a time that ROS cannot write."""
    if not 0 <= t_us < 2**32 * 10**6:
        raise InputError(f"bag: a time of {t_us} us, and ROS has 0 to 2^32 s; shift the recording's times")
    return struct.pack("<III", 0, t_us // 10**6, t_us % 10**6 * 1000) + text(frame)


def text(value: str) -> bytes:
    """A string as a message holds it."""
    return struct.pack("<I", len(value)) + value.encode()


def _camera_info(camera: Camera) -> bytes:
    """A sensor_msgs/CameraInfo behind its header; k1, k2, p1, p2, k3 are the plumb_bob model's."""
    fisheye = camera.distortion_model == "equidistant"
    D = np.zeros(4 if fisheye else 5)
    D[: len(camera.distortion)] = camera.distortion
    P = np.column_stack([camera.K, np.zeros(3)])
    model = b"equidistant" if fisheye else b"plumb_bob"
    body = struct.pack(f"<III{len(model)}sI", camera.height_px, camera.width_px, len(model), model, len(D))
    body += np.concatenate([D, camera.K.ravel(), np.eye(3).ravel(), P.ravel()]).astype("<f8").tobytes()
    return body + bytes(4 + 4 + 17)  # no binning, no region of interest
