"""What ROS 1 and ROS 2 bags have in common: turning topics of events and images into a recording."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from functools import partial
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .. import plugins
from ..types import InputError
from .images import decode
from .limits import check_image
from .stream import Source, in_chunks, nothing

IMAGES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
EVENTS = ("/EventArray", "/EventPacket")  # ends of the types of event messages
ARRAY = "dvs_msgs/msg/EventArray"  # of the paper's laboratory


class Unread(ValueError):
    """A topic holds something that no reader can read; the message names it."""


class Dialect(NamedTuple):
    """How bags of one kind are read.

    ``open(path)`` is a context manager that gives the reader and turns errors from damaged bytes into an
    `InputError`.  ``decoder()`` makes a function, for one pass over the messages in order, from ``(reader,
    connection, bytes, header's time)`` to ``((width, height), events)``; ``deserialize`` decodes any message.
    ``stamp`` gives seconds and nanoseconds of a message's header.  ``packed`` lists the types of messages
    with packed events; if it is empty, the dialect knows only `ARRAY`.
    """

    open: Callable[[Path], AbstractContextManager]
    decoder: Callable[[], Callable]
    deserialize: Callable
    stamp: Callable[[bytes], tuple[int, int]]
    packed: tuple[str, ...] = ()

    def time_us(self, raw: bytes) -> int:
        """A message's time, rounded to microseconds."""
        seconds, nanoseconds = self.stamp(raw)
        return seconds * 10**6 + (nanoseconds + 500) // 1000

    def image(self, bag, connection, raw: bytes) -> np.ndarray:
        """The image (H, W, 3) of a message, u8 or u16; raises `Unread`."""
        message = self.deserialize(bag, connection, raw)
        if not hasattr(message, "format"):
            return _pixels(message)
        if "compressedDepth" in message.format:
            raise Unread(f"images encoded as {message.format[:40]}")
        return decode(bytes(message.data))


class Topic(NamedTuple):
    """A topic to read: its name, the size and type of its first image or events, and whether its messages
    lack stamps and its events lack times."""

    name: str
    size_px: tuple[int, int]
    dtype: np.dtype
    no_stamps: bool
    no_times: bool

    def messages(self, bag, dialect: Dialect) -> Iterator[tuple]:
        """Yield connection, bytes and time (us) of each message: its stamp or, without stamps, when it was
        recorded."""
        for connection, recorded_ns, raw in _messages(bag, self.name):
            yield connection, raw, recorded_ns // 1000 if self.no_stamps else dialect.time_us(raw)


def read(path: Path, dialect: Dialect) -> Source | None:
    """Read a topic of events and one of images; None for a bag with events that the dialect does not know.

    Raises
    ------
    InputError
        If no topic can be read.
    """
    with dialect.open(path) as bag:
        kinds = {c.msgtype for c in bag.connections if _kind(c.msgtype) == "events"}
        if not dialect.packed and kinds - {ARRAY}:
            return None
        if not any(_kind(c.msgtype) for c in bag.connections):
            raise ValueError(f"no EventArray, EventPacket or image in {len(bag.topics)} topics")
        unread: list[str] = []
        events, images = (_topic(bag, path, dialect, kind, unread) for kind in ("events", "images"))
        if not (events or images or unread):
            raise ValueError("no message in its topics")
        span_us = int(bag.start_time) // 1000, int(bag.end_time) // 1000  # a description may state any number
        details: Callable[[], dict] = partial(dict, topics=_topics(bag))
    if not (events or images):
        raise InputError(f"{path}: cannot read {'; '.join(unread)}; convert them to another encoding")
    for text in unread:
        warnings.warn(f"{path}: left out {text}", stacklevel=4)
    event_chunks = partial(_events, path, dialect, events) if events else nothing
    frames = partial(_frames, path, dialect, images) if images else nothing
    topics = [topic for topic in (events, images) if topic]
    names = tuple(topic.name for topic in topics)
    describe = plugins.reader("camera_infos")
    cameras = describe(path, dialect, names) if describe else dict
    return Source(path, topics[0].size_px, event_chunks, frames, span_us, details, cameras, names)


def _events(path: Path, dialect: Dialect, topic: Topic) -> Iterator[np.ndarray]:
    decode_events = dialect.decoder()

    def batches(bag):
        for connection, raw, header_us in topic.messages(bag, dialect):
            size, batch = decode_events(bag, connection, raw, header_us)
            if size != topic.size_px:
                raise ValueError(f"events for {size} px among those for {topic.size_px} px")
            if topic.no_times:
                batch["t_us"] = header_us
            yield batch

    with dialect.open(path) as bag:
        yield from in_chunks(batches(bag))


def _frames(path: Path, dialect: Dialect, topic: Topic) -> Iterator[tuple[int, np.ndarray]]:
    with dialect.open(path) as bag:
        for connection, raw, header_us in topic.messages(bag, dialect):
            yield header_us, dialect.image(bag, connection, raw)


def _topic(bag, path: Path, dialect: Dialect, kind: str, unread: list[str]) -> Topic | None:
    """The first topic of a kind that can be read, of depth only where there is no other; a warning names the
    others.  ``unread`` takes the reasons where none can be read."""
    names, readable, reasons = {c.topic for c in bag.connections if _kind(c.msgtype) == kind}, [], []
    for name in sorted(names):
        try:
            if first := list(islice(_messages(bag, name), 2)):
                readable.append(_look(bag, dialect, name, first))
        except Unread as reason:
            reasons.append(f"{name} ({reason})")
    if not readable:
        unread.extend(reasons)
        return None
    topic = min(readable, key=lambda topic: ("depth" in topic.name.lower(), topic.dtype == np.uint16))
    if skipped := sorted(names - {topic.name}):
        warnings.warn(f"{path}: taking {topic.name}, not {', '.join(skipped)}", stacklevel=4)
    if topic.no_stamps or topic.no_times:
        taken = "stamps of its messages" if not topic.no_stamps else "times at which it was recorded"
        warnings.warn(f"{path}: the times of {topic.name} are zero; taking the {taken}", stacklevel=4)
    return topic


def _look(bag, dialect: Dialect, name: str, first: list[tuple]) -> Topic:
    """What the first two messages of a topic say."""
    no_stamps = not any(dialect.time_us(raw) for _, _, raw in first)
    connection, recorded_ns, raw = first[0]
    if _kind(connection.msgtype) == "images":
        image = dialect.image(bag, connection, raw)
        return Topic(name, image.shape[1::-1], image.dtype, no_stamps, False)
    size_px, events = dialect.decoder()(bag, connection, raw, 0)
    is_array, recorded_us = connection.msgtype not in dialect.packed, recorded_ns // 1000
    stamp_us = recorded_us if no_stamps else dialect.time_us(raw)
    no_times = bool(is_array and stamp_us and len(events) and not events["t_us"].any())
    return Topic(name, size_px, events.dtype, no_stamps, no_times)


def _pixels(message) -> np.ndarray:
    """The image (H, W, 3) of a sensor_msgs/Image: RGB of 8 bits here, any other by readers;
    raises `Unread`."""
    if message.encoding != "rgb8":
        if other := plugins.reader("encoding"):
            return other(message)
        raise Unread(f"images encoded as {message.encoding[:40]}")
    check_image(message.width, message.height)
    rows = np.asarray(message.data).reshape(message.height, message.step)[:, : 3 * message.width]
    return np.ascontiguousarray(rows).reshape(message.height, message.width, 3)


def _kind(msgtype: str) -> str | None:
    return "events" if msgtype.endswith(EVENTS) else "images" if msgtype in IMAGES else None


def _messages(bag, topic: str) -> Iterator[tuple]:
    return bag.messages([c for c in bag.connections if c.topic == topic])


def _topics(bag) -> list[str]:
    """Each topic with its type and its number of messages."""
    topics = sorted(bag.topics.items())
    return [f"{name} ({topic.msgtype or 'several types'}, {topic.msgcount})" for name, topic in topics]
