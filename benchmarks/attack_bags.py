"""Bags that each violate their format in one way."""

from __future__ import annotations

import bz2
import sqlite3
import struct
from contextlib import closing
from pathlib import Path

import lz4.frame
from backports import zstd


class Files(dict[str, Path]):
    """Paths in a folder by what they are called."""

    def __init__(self, folder: Path):
        self._in = folder

    def path(self, name: str) -> Path:
        """A new file's path."""
        self[name] = self._in / name.replace(" ", "-")
        return self[name]

    def folder(self, name: str) -> Path:
        """A new folder."""
        self.path(name).mkdir()
        return self[name]


def directed_bags(files: Files) -> None:
    """Bags with one chunk that inflates beyond the limit, or claims to."""

    def fields(**values: bytes) -> bytes:
        pairs = (name.encode() + b"=" + value for name, value in values.items())
        return b"".join(struct.pack("<I", len(pair)) + pair for pair in pairs)

    def record(data: bytes, **values: bytes) -> bytes:
        head = fields(**values)
        return struct.pack("<I", len(head)) + head + struct.pack("<I", len(data)) + data

    packer = bz2.BZ2Compressor(9)
    bomb = b"".join(packer.compress(bytes(2**24)) for _ in range(17)) + packer.flush()
    at, one = 13 + 4096, struct.pack("<I", 1)
    for name, size in (("bomb.bag", 1000), ("promise.bag", 2**32 - 1)):
        chunk = record(bomb, op=b"\x05", compression=b"bz2", size=struct.pack("<I", size))
        index = record(struct.pack("<III", 1, 0, 0), op=b"\x04", ver=one, conn=bytes(4), count=one)
        about = {"topic": b"/dvs/events", "type": b"dvs_msgs/EventArray", "md5sum": b"*"}
        about = fields(**about, message_definition=b"Header header\n")
        connection = record(about, op=b"\x07", conn=bytes(4), topic=b"/dvs/events")
        info = record(struct.pack("<II", 0, 1), op=b"\x06", ver=one, chunk_pos=struct.pack("<Q", at),
                      start_time=bytes(8), end_time=bytes(8), count=one)  # fmt: skip
        head = {"op": b"\x03", "index_pos": struct.pack("<Q", at + len(chunk) + len(index))}
        head |= {"conn_count": one, "chunk_count": one}
        header = record(b" " * (4096 - 8 - len(fields(**head))), **head)
        files.path(name).write_bytes(b"#ROSBAG V2.0\n" + header + chunk + index + connection + info)


def directed_ros2(files: Files) -> None:
    """Chunks, messages, files and columns that unpack to gigabytes, or an index that names a chunk often."""
    zeros = bytes(2**24)
    lz4_packer, zstd_packer = lz4.frame.LZ4FrameCompressor(), zstd.ZstdCompressor()
    bombs = {
        "lz4": b"".join([lz4_packer.begin(), *(lz4_packer.compress(zeros) for _ in range(128))]),
        "zstd": b"".join(zstd_packer.compress(zeros) for _ in range(128)) + zstd_packer.flush(),
    }
    bombs["lz4"] += lz4_packer.flush()
    for kind, bomb in bombs.items():
        for name, size in (("lie", 1000), ("promise", 2**31), ("absurd", 2**62)):
            files.path(f"{name}-{kind}.mcap").write_bytes(_mcap(bomb, kind, size))
    files.path("repeated.mcap").write_bytes(_mcap(zstd.compress(bytes(2**27)), "zstd", 2**27, 500))
    size = len(bombs["zstd"])
    message = b"\x05" + struct.pack("<QHIQQ", 22 + size, 1, 0, 1, 1) + bombs["zstd"]
    packed = {
        "packed file": ("FILE", bombs["zstd"]),
        "packed messages": ("MESSAGE", _mcap(message, "", 31 + size)),
    }
    for name, (mode, content) in packed.items():
        bag = files.folder(name)
        inside = "b.mcap.zstd" if mode == "FILE" else "b.mcap"
        (bag / inside).write_bytes(content)
        (bag / "metadata.yaml").write_text(_METADATA.format(mode=mode, name=inside))
    bag = files.folder("aliases")
    levels = "".join(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]\n" for k in range(1, 10))
    (bag / "metadata.yaml").write_text("a0: &a0 [1]\n" + levels + "rosbag2_bagfile_information: *a9\n")
    with closing(sqlite3.connect(files.path("computed.db3"))) as database:
        database.executescript(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT,"
            " offered_qos_profiles TEXT);"
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER,"
            " data BLOB GENERATED ALWAYS AS (zeroblob(1000000000)) VIRTUAL);"
            "INSERT INTO topics VALUES (1, '/e', 'dvs_msgs/msg/EventArray', 'cdr', '');"
            "INSERT INTO messages(topic_id, timestamp) VALUES (1, 1), (1, 2), (1, 3);"
        )


_METADATA = """rosbag2_bagfile_information:
  version: 5
  storage_identifier: mcap
  relative_file_paths: [{name}]
  duration: {{nanoseconds: 1}}
  starting_time: {{nanoseconds_since_epoch: 1}}
  message_count: 1
  compression_format: zstd
  compression_mode: {mode}
  topics_with_message_count:
    - message_count: 1
      topic_metadata:
        {{name: /e, type: dvs_msgs/msg/EventArray, serialization_format: cdr, offered_qos_profiles: ''}}
"""


def _mcap(packed: bytes, compression: str, size: int, times: int = 1) -> bytes:
    """An MCAP file of one chunk, which its index lists ``times`` times."""

    def text(value: str) -> bytes:
        return struct.pack("<I", len(value)) + value.encode()

    def record(kind: int, content: bytes) -> bytes:
        return struct.pack("<BQ", kind, len(content)) + content

    magic = b"\x89MCAP0\r\n"
    head = magic + record(1, text("ros2") + text("lmmap"))
    body = struct.pack("<QQQI", 1, 2, size, 0) + text(compression) + struct.pack("<Q", len(packed)) + packed
    chunk = record(6, body)
    schema = record(
        3,
        struct.pack("<H", 1)
        + text("dvs_msgs/msg/EventArray")
        + text("ros2msg")
        + text("std_msgs/Header header"),
    )
    channel = record(4, struct.pack("<HH", 1, 1) + text("/e") + text("cdr") + struct.pack("<I", 0))
    named = struct.pack("<QQQQIQ", 1, 2, len(head), len(chunk), 0, 0) + text(compression)
    index = record(8, named + struct.pack("<QQ", len(packed), size)) * times
    statistics = record(11, struct.pack("<QHIIIIQQI", 1, 1, 1, 0, 0, 1, 1, 2, 0))
    footer = record(2, struct.pack("<QQI", len(head) + len(chunk), 0, 0))
    return head + chunk + schema + channel + index + statistics + footer + magic
