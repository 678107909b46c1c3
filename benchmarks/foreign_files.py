"""Writers of formats that the package only reads: ROS 2 bags, Prophesee's RAW and DAT, Event Stream.

For tests and for the attack suite; each follows the published layout, bit for bit.
"""

from __future__ import annotations

import struct

import numpy as np
from rosbags.rosbag2 import CompressionFormat, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)
STORE.register(
    get_types_from_msg(
        "uint16 x\nuint16 y\nbuiltin_interfaces/Time ts\nbool polarity\n", "dvs_msgs/msg/Event"
    )
    | get_types_from_msg(
        "std_msgs/Header header\nuint32 height\nuint32 width\ndvs_msgs/Event[] events\n",
        "dvs_msgs/msg/EventArray",
    )
    | get_types_from_msg(
        "std_msgs/Header header\nuint32 height\nuint32 width\nuint64 seq\nuint64 time_base\n"
        "string encoding\nbool is_bigendian\nuint8[] events\n",
        "event_camera_msgs/msg/EventPacket",
    )
)
KINDS = STORE.types
START_US = 1_600_000_000_123_456


# --- ROS 2 ----------------------------------------------------------------------------------------


def header(t_us, frame="camera"):
    stamp = KINDS["builtin_interfaces/msg/Time"](sec=t_us // 10**6, nanosec=t_us % 10**6 * 1000)
    return KINDS["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)


def array(events, frame="camera", size_px=(64, 48), t_us=START_US):
    """A message of dvs_msgs/EventArray, for the library's own serialiser; ``t_us`` where it is empty."""
    time = KINDS["builtin_interfaces/msg/Time"]
    rows = [
        KINDS["dvs_msgs/msg/Event"](x=x, y=y, ts=time(sec=t // 10**6, nanosec=t % 10**6 * 1000), polarity=p)
        for t, x, y, p in events.tolist()
    ]
    t_us = int(events["t_us"][-1]) if len(events) else t_us
    width, height = size_px
    return KINDS["dvs_msgs/msg/EventArray"](
        header=header(t_us, frame), height=height, width=width, events=rows
    )


def packet(encoding, packed, t_us, time_base=0, **changes):
    values = dict(header=header(t_us), height=48, width=64, seq=0, time_base=time_base, encoding=encoding,
                  is_bigendian=False, events=np.frombuffer(packed, np.uint8))  # fmt: skip
    return KINDS["event_camera_msgs/msg/EventPacket"](**values | changes)


def bag(path, messages, storage=StoragePlugin.MCAP, compression=None):
    """Messages ``(topic, message, t_us)`` as a bag; compressed by the library's mode, if one is given."""
    writer = Writer(path, version=9, storage_plugin=storage)
    if compression is not None:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for topic, message, t_us in messages:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(connections[topic], t_us * 1000, bytes(STORE.serialize_cdr(message, kind)))
    return path


def image(frame, t_us, encoding="rgb8"):
    height, width, channels = (*frame.shape, 1)[:3]
    return KINDS["sensor_msgs/msg/Image"](
        header=header(t_us),
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=0,
        step=width * channels,
        data=frame.ravel(),
    )


# --- Prophesee ------------------------------------------------------------------------------------


def evt2(events, size_px=(1280, 720)) -> bytes:
    words, high = [], None
    for t, x, y, p in events.tolist():
        if t >> 6 != high:
            high = t >> 6
            words.append(8 << 28 | high & 0xFFF_FFFF)
        words.append(int(p) << 28 | (t & 0x3F) << 22 | x << 11 | y)
    return (
        b"% evt 2.0\n% format EVT2"
        + _size(size_px).encode()
        + b"% end\n"
        + struct.pack(f"<{len(words)}I", *words)
    )


def evt21(events, legacy=False, size_px=(1280, 720)) -> bytes:
    words, high = [], None
    for t, x, y, p in events.tolist():
        if t >> 6 != high:
            high = t >> 6
            words.append((8 << 28 | high & 0xFFF_FFFF) << 32)
        upper = int(p) << 28 | (t & 0x3F) << 22 | x // 32 * 32 << 11 | y
        if words[-1] >> 32 == upper and words[-1] & 0xFFFF_FFFF < 1 << x % 32:
            words[-1] |= 1 << x % 32
        else:
            words.append(upper << 32 | 1 << x % 32)
    order = "legacy" if legacy else "little"
    head = f"% evt 2.1\n% format EVT21;endianness={order}{_size(size_px)}% end\n".encode()
    halves = [(w >> 32, w & 0xFFFF_FFFF) if legacy else (w & 0xFFFF_FFFF, w >> 32) for w in words]
    return head + b"".join(struct.pack("<2I", *pair) for pair in halves)


def evt3(events, size_px=(1280, 720)) -> bytes:
    """Vectors of 12, 12 and 8 where two or more neighbours follow one another, else single events."""
    words, time, row, k = [], None, None, 0
    rows = events.tolist()
    while k < len(rows):
        t, x, y, p = rows[k]
        if time is None or t >> 12 != time >> 12:
            words.append(8 << 12 | t >> 12 & 0xFFF)
        if t != time:
            words.append(6 << 12 | t & 0xFFF)
        if y != row:
            words.append(y)
        time, row, end = t, y, k
        while end < len(rows) and rows[end][0] == t and rows[end][2:] == (y, p):
            if rows[end][1] >= x + 32 or (end > k and rows[end][1] <= rows[end - 1][1]):
                break
            end += 1
        if end - k > 1:
            words.append(3 << 12 | int(p) << 11 | x)
            bits = sum(1 << (r[1] - x) for r in rows[k:end])
            words += [4 << 12 | bits & 0xFFF, 4 << 12 | bits >> 12 & 0xFFF, 5 << 12 | bits >> 24 & 0xFF]
        else:
            words.append(2 << 12 | int(p) << 11 | x)
        k = end
    head = f"% evt 3.0\n% format EVT3{_size(size_px)}% end\n".encode()
    return head + struct.pack(f"<{len(words)}H", *words)


def dat(events, size_px=(1280, 720)) -> bytes:
    width, height = size_px
    size = f"% Width {width}\n% Height {height}\n"
    head = f"% Data file containing CD events\n% Version 2\n{size}\x0c\x08".encode()
    return head + b"".join(
        struct.pack("<II", t & 0xFFFF_FFFF, int(p) << 28 | y << 14 | x) for t, x, y, p in events.tolist()
    )


def es(events, size_px=(1280, 720)) -> bytes:
    """Times from 0 on; a byte of 255 for each 127 us without events."""
    content, last_us = [b"Event Stream", bytes([2, 0, 0, 1]), struct.pack("<HH", *size_px)], 0
    for t, x, y, p in events.tolist():
        overflows, since_us = divmod(t - last_us, 127)
        content.append(b"\xff" * overflows + struct.pack("<BHH", since_us << 1 | p, x, size_px[1] - 1 - y))
        last_us = t
    return b"".join(content)


def _size(size_px: tuple[int, int]) -> str:
    return f";height={size_px[1]};width={size_px[0]}\n"
