"""What ROS 1 and ROS 2 bags have in common: topics of events and of images, made a recording."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from functools import partial
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from .images import decode
from .limits import check_image
from .stream import Source, in_chunks

CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
TO_RGB = {
    "mono8": cv2.COLOR_GRAY2RGB, "8UC1": cv2.COLOR_GRAY2RGB,
    "bgr8": cv2.COLOR_BGR2RGB, "8UC3": cv2.COLOR_BGR2RGB,
    "rgb8": None, "rgba8": cv2.COLOR_RGBA2RGB, "bgra8": cv2.COLOR_BGRA2RGB,
    "bayer_rggb8": cv2.COLOR_BayerRGGB2RGB, "bayer_bggr8": cv2.COLOR_BayerBGGR2RGB,
    "bayer_grbg8": cv2.COLOR_BayerGRBG2RGB, "bayer_gbrg8": cv2.COLOR_BayerGBRG2RGB,
}  # fmt: skip


class Dialect(NamedTuple):
    """How bags of one kind are read.

    ``open(path)`` gives a block its reader, and what damaged bytes raise there is an `InputError`.
    ``event_kinds`` end the types of event messages.  ``decoder()`` makes a function, for one pass over the
    messages in their order, from ``(reader, connection, bytes)`` to ``((width, height), events)``;
    ``deserialize`` makes a message of the same.
    """

    open: Callable[[Path], AbstractContextManager]
    event_kinds: tuple[str, ...]
    decoder: Callable[[], Callable]
    deserialize: Callable

    def has_events(self, kind: str) -> bool:
        return kind.endswith(self.event_kinds)

    def image(self, bag, connection, raw: bytes) -> tuple[int, np.ndarray]:
        message = self.deserialize(bag, connection, raw)
        return time_us(message.header.stamp), _rgb(message)


def read(path: Path, dialect: Dialect) -> Source:
    """The first topic of each kind; raises `InputError`."""
    with dialect.open(path) as bag:
        topics = [_first_topic(bag, path, wanted) for wanted in (dialect.has_events, IMAGES.__contains__)]
        if not any(topics):
            kinds = ", ".join(kind.strip("/") for kind in dialect.event_kinds)
            raise ValueError(f"no {kinds} or image in {len(bag.topics)} topics")
        first = next((message for topic in topics if topic for message in bag.messages(topic)), None)
        if first is None:
            raise ValueError("no message in its topics")
        connection, _, raw = first
        if dialect.has_events(connection.msgtype):
            size_px, _ = dialect.decoder()(bag, connection, raw)
        else:
            size_px = dialect.image(bag, connection, raw)[1].shape[1::-1]
        span_us = int(bag.start_time) // 1000, int(bag.end_time) // 1000  # a description may state any number
        details = partial(dict, topics=_topics(bag))
    events, frames = partial(_events, path, dialect, size_px), partial(_frames, path, dialect)
    names = tuple(topic[0].topic for topic in topics if topic)
    cameras = partial(_cameras, path, dialect, all(re.search("_rect|rectified", name) for name in names))
    return Source(path, size_px, events, frames, span_us, details, cameras, names)


def _cameras(path: Path, dialect: Dialect, rectified: bool) -> dict[str, dict]:
    """What the topics of sensor_msgs/CameraInfo say first, as `lmmap.calibrations` reads it; of a camera that
    is not calibrated, nothing.  Of images that are ``rectified`` it is the projection, without distortion."""
    cameras = {}
    with dialect.open(path) as bag:
        for c in sorted((c for c in bag.connections if c.msgtype == CAMERA_INFO), key=lambda c: c.topic):
            for connection, _, raw in islice(bag.messages([c]), 1):
                info = {k.lower(): v for k, v in vars(dialect.deserialize(bag, connection, raw)).items()}
                values = {name: info[name] for name in ("width", "height", "distortion_model")}
                P = info["p"].reshape(3, 4)[:, :3].ravel()
                values |= {"k": P.tolist(), "d": []} if rectified else {n: info[n].tolist() for n in "kd"}
                if values["k"][0]:
                    cameras[c.topic] = values | {"rostopic": c.topic}
    return cameras


def _events(path: Path, dialect: Dialect, size_px: tuple[int, int]) -> Iterator[np.ndarray]:
    decode_events = dialect.decoder()

    def batches(bag):
        for connection, _, raw in _messages(bag, path, dialect.has_events):
            size, batch = decode_events(bag, connection, raw)
            if size != size_px:
                raise ValueError(f"events for {size} px among those for {size_px} px")
            yield batch

    with dialect.open(path) as bag:
        yield from in_chunks(batches(bag))


def _frames(path: Path, dialect: Dialect) -> Iterator[tuple[int, np.ndarray]]:
    with dialect.open(path) as bag:
        for connection, _, raw in _messages(bag, path, IMAGES.__contains__):
            yield dialect.image(bag, connection, raw)


def _messages(bag, path: Path, wanted):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # said when the file was opened
        connections = _first_topic(bag, path, wanted)
    return bag.messages(connections) if connections else iter(())  # of no connection means of all


def _first_topic(bag, path: Path, wanted) -> list:
    """Connections of the first topic whose type is ``wanted``; a warning names the others."""
    connections = sorted((c for c in bag.connections if wanted(c.msgtype)), key=lambda c: c.topic)
    if skipped := sorted({c.topic for c in connections} - {c.topic for c in connections[:1]}):
        warnings.warn(f"{path}: taking {connections[0].topic}, not {', '.join(skipped)}", stacklevel=4)
    return [c for c in connections if c.topic == connections[0].topic]


def _topics(bag) -> list[str]:
    """Each topic with its type and its number of messages."""
    topics = sorted(bag.topics.items())
    return [f"{name} ({topic.msgtype or 'several types'}, {topic.msgcount})" for name, topic in topics]


def time_us(stamp) -> int:
    """A message's time, rounded to microseconds."""
    return stamp.sec * 10**6 + (stamp.nanosec + 500) // 1000


def _rgb(message) -> np.ndarray:
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
