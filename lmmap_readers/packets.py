"""Decode packets of event_camera_msgs, formerly event_array_msgs, and read the ROS 1 bags that hold them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lmmap.recordings import bags, rosbag
from lmmap.recordings.bags import Unread

from . import evt

PACKETS = ("event_camera_msgs/msg/EventPacket", "event_array_msgs/msg/EventArray")  # of packed events
DEFINITION = """std_msgs/Header header
uint32 height
uint32 width
uint64 seq
uint64 time_base
string encoding
bool is_bigendian
uint8[] events
"""
STREAMS = {"evt3": evt.Evt3, "evt21": evt.Evt21, "evt2": evt.Evt2}  # of the sensor, cut anywhere
PACKED = {"libcaer_cmp": evt.Evt3.word, "libcaer": evt.LIBCAER, "mono": evt.MONO}  # counted from a base
SAME_CLOCK_US = 1_000_000  # between a base and its header, both of ROS


class Packets:
    """Decode the events of packets in order, at the times of their headers.

    Times in a sensor's stream are the sensor's, and time bases may be: they are shifted so that the first
    packet begins at its header's time.  Bases near that time are ROS times and are not shifted.
    """

    def __init__(self):
        self._streams, self._shift_us = {name: make() for name, make in STREAMS.items()}, None
        self._libcaer = evt.Evt3(evt.LIBCAER_CMP)

    def __call__(self, message, header_us: int) -> np.ndarray:
        """Events (M,) EVENT of a message; raises `Unread`, and ValueError for a damaged one."""
        if message.is_bigendian:
            raise Unread("event packets in big-endian order")
        name, packed = message.encoding, np.asarray(message.events, np.uint8)
        if name in STREAMS:
            events, base_us = self._streams[name].events(_words(packed, STREAMS[name].word)), 0
            start_us = int(events["t_us"][0]) if len(events) else None
        elif name in PACKED:
            base_us = start_us = (message.time_base + 500) // 1000
            words = _words(packed, PACKED[name])
            if name == "libcaer_cmp":
                self._libcaer.start_at_zero()
                events = self._libcaer.events(words)
            elif name == "libcaer":
                events = evt.libcaer(words)
                start_us = base_us + int(events["t_us"][0]) if len(events) else None
            else:
                events, base_us = evt.mono(words, message.time_base), 0
        else:
            expected = ", ".join((*STREAMS, *PACKED))
            raise Unread(f"event packets encoded as {name[:40]}, expected {expected}")
        if self._shift_us is None and start_us is not None:
            shift_us = header_us - start_us
            self._shift_us = shift_us if name in STREAMS or abs(shift_us) > SAME_CLOCK_US else 0
        events["t_us"] += base_us + (self._shift_us or 0)
        return events


def _words(packed: np.ndarray, word: np.dtype) -> np.ndarray:
    if len(packed) % word.itemsize:
        raise ValueError(f"an event packet of {len(packed)} bytes, expected a multiple of {word.itemsize}")
    return packed.view(word)


STORE = get_typestore(Stores.ROS1_NOETIC)
for _name in PACKETS:
    STORE.register(get_types_from_msg(DEFINITION, _name))


def decoder(arrays: Callable, deserialize: Callable) -> Callable[[], Callable]:
    """`bags.Dialect.decoder` for bags with packets and event arrays, the latter decoded by ``arrays``."""

    def for_one_pass() -> Callable:
        packets = Packets()

        def decode(bag, connection, raw: bytes, header_us: int):
            if connection.msgtype not in PACKETS:
                return arrays(bag, connection, raw, header_us)
            message = deserialize(bag, connection, raw)
            return (message.width, message.height), packets(message, header_us)

        return decode

    return for_one_pass


def _deserialize(_, connection, raw: bytes):
    return STORE.deserialize_ros1(raw, connection.msgtype)


ROS1 = rosbag.ROS1._replace(
    decoder=decoder(rosbag.ROS1.decoder(), _deserialize), deserialize=_deserialize, packed=PACKETS
)
read_bag = partial(bags.read, dialect=ROS1)
