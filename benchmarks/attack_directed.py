"""Files that each break one promise of their format: bombs, devices, absurd counts, sizes and times."""

from __future__ import annotations

import bz2
import os
import sqlite3
import struct
import zlib
from contextlib import closing
from pathlib import Path

import cv2
import h5py
import lz4.frame
import numpy as np
from backports import zstd

SUFFIXES = (
    *(".aedat4", ".bag", ".h5", ".txt", ".avi", ".mcap", ".db3", ".raw", ".dat", ".es", ".csv", ".npy"),
    ".png",
)


def directed_files(folder: Path) -> dict[str, Path]:
    """Files that each break one promise of their format."""
    files = {}

    def add(name: str, content: bytes) -> None:
        files[name] = folder / name
        files[name].write_bytes(content)

    for suffix in SUFFIXES:
        files[f"fifo{suffix}"] = folder / f"fifo{suffix}"
        os.mkfifo(files[f"fifo{suffix}"])
        files[f"zero{suffix}"] = folder / f"zero{suffix}"
        files[f"zero{suffix}"].symlink_to("/dev/zero")
        files[f"sparse{suffix}"] = folder / f"sparse{suffix}"
        with files[f"sparse{suffix}"].open("wb") as file:
            file.truncate(2**33)
    with (folder / "line.txt").open("wb") as file:  # one line, whose end never comes
        file.write(b"1.0 1 1 1 ")
        file.truncate(2**32)
    files["line.txt"] = folder / "line.txt"
    for name, t_us in (("gap", 3_600_000_000), ("epoch", 1_700_000_000_000_000), ("end", 2**62)):
        add(
            f"{name}.txt",
            b"".join(b"%d %d 5 1\n" % (k * 50 + (t_us if k > 9000 else 0), k % 64) for k in range(18_000)),
        )
    add("int64.txt", b"9223372036854775807 1 1 1\n" * 50)
    add("seconds.txt", b"9.9e300 1 1 1\n" * 50)
    _directed_hdf5(files, folder)
    _directed_bags(files, folder)
    _directed_ros2(files, folder)
    _directed_tables(files, folder)
    body = _deflated_zeros((2**16 * 3 + 1) * 2**12)
    for name, height in (("gigapixel", 2**14), ("cut", 2**12)):
        pictures = files[f"{name} folder"] = folder / name
        pictures.mkdir()
        (pictures / "0.png").write_bytes(_png(2**16, height, body))
        (pictures / "timestamps.txt").write_text("1.0\n")
    for name, time_text in (("huge", "9.9e300"), ("int", "9" * 30), ("nan", "nan."), ("negative", "-1.5")):
        pictures = files[f"{name} times"] = folder / f"times-{name}"
        pictures.mkdir()
        cv2.imwrite(str(pictures / "0.png"), np.zeros((48, 64, 3), np.uint8))
        (pictures / "timestamps.txt").write_text(f"{time_text}\n")
    return files


def _deflated_zeros(count: int) -> bytes:
    """At least so many zeros as a deflated stream, made of equal blocks; its checksum is not theirs."""
    packer = zlib.compressobj(9)
    first, block = (packer.compress(bytes(2**24)) + packer.flush(zlib.Z_FULL_FLUSH) for _ in range(2))
    return first + block * (count // 2**24) + packer.flush()


def _png(width: int, height: int, body: bytes) -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", body) + chunk(b"IEND", b"")


def _directed_hdf5(files: dict, folder: Path) -> None:
    def columns(file, count, **layout):
        for name, dtype in (("t", "<i8"), ("x", "<u2"), ("y", "<u2"), ("p", "u1")):
            file.create_dataset(f"events/{name}", (count,), dtype, **layout)

    for name, count, layout in (
        ("never", 10**8, {"chunks": (10**6,)}),
        ("never-large", 10**12, {"chunks": (10**6,)}),
        ("never-contiguous", 10**9, {}),
        ("large-chunks", 2**31, {"chunks": (2**29,)}),
    ):
        files[f"{name}.h5"] = folder / f"{name}.h5"
        with h5py.File(files[f"{name}.h5"], "w") as file:
            columns(file, count, **layout)
    files["bomb.h5"] = folder / "bomb.h5"
    with h5py.File(files["bomb.h5"], "w") as file:
        columns(file, 10**6, chunks=(10**6,), compression="gzip")
        bomb = _deflated_zeros(2**31)
        for name in "txyp":
            file[f"events/{name}"].id.write_direct_chunk((0,), bomb)
    files["external.h5"] = folder / "external.h5"
    with h5py.File(files["external.h5"], "w") as file:
        columns(file, 10, external=[("/etc/passwd", 0, h5py.h5f.UNLIMITED)])
    files["filter.h5"] = folder / "filter.h5"
    with h5py.File(files["filter.h5"], "w") as file:
        import hdf5plugin

        columns(file, 1000, chunks=(1000,), **hdf5plugin.Bitshuffle())
        for name in "txyp":
            file[f"events/{name}"][:] = 0
            file[f"events/{name}"].id.write_direct_chunk((0,), os.urandom(200))
    files["frames.h5"] = folder / "frames.h5"
    with h5py.File(files["frames.h5"], "w") as file:
        columns(file, 10)
        file.create_dataset("frames", (10**6, 48, 64, 3), "u1", chunks=(1, 48, 64, 3), compression="gzip")
        file["frames_t_us"] = np.arange(10**6)


def _directed_bags(files: dict, folder: Path) -> None:
    """Bags whose one chunk inflates to more than is allowed, or says that it does."""

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
        files[name] = folder / name
        files[name].write_bytes(b"#ROSBAG V2.0\n" + header + chunk + index + connection + info)


def _directed_ros2(files: dict, folder: Path) -> None:
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
            files[f"{name}-{kind}.mcap"] = folder / f"{name}-{kind}.mcap"
            files[f"{name}-{kind}.mcap"].write_bytes(_mcap(bomb, kind, size))
    files["repeated.mcap"] = folder / "repeated.mcap"
    files["repeated.mcap"].write_bytes(_mcap(zstd.compress(bytes(2**27)), "zstd", 2**27, 500))
    size = len(bombs["zstd"])
    message = b"\x05" + struct.pack("<QHIQQ", 22 + size, 1, 0, 1, 1) + bombs["zstd"]
    packed = {
        "packed file": ("FILE", bombs["zstd"]),
        "packed messages": ("MESSAGE", _mcap(message, "", 31 + size)),
    }
    for name, (mode, content) in packed.items():
        bag = files[name] = folder / name.replace(" ", "-")
        bag.mkdir()
        inside = "b.mcap.zstd" if mode == "FILE" else "b.mcap"
        (bag / inside).write_bytes(content)
        (bag / "metadata.yaml").write_text(_METADATA.format(mode=mode, name=inside))
    bag = files["aliases"] = folder / "aliases"
    bag.mkdir()
    levels = "".join(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]\n" for k in range(1, 10))
    (bag / "metadata.yaml").write_text("a0: &a0 [1]\n" + levels + "rosbag2_bagfile_information: *a9\n")
    files["computed.db3"] = folder / "computed.db3"
    with closing(sqlite3.connect(files["computed.db3"])) as database:
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
    """A file of one chunk, which its index names so many times."""

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


def _directed_tables(files: dict, folder: Path) -> None:
    """Tables and RAW files whose headers promise what the file does not hold."""
    head = "{{'descr': {descr}, 'fortran_order': False, 'shape': ({count},), }}"
    event = "[('t', '<i8'), ('x', '<u2'), ('y', '<u2'), ('p', '?')]"
    for name, descr, count in (
        ("many.npy", event, 10**12),
        ("absurd.npy", event, 10**30),
        ("object.npy", "'|O'", 3),
        ("wide.npy", "[('t', '<i8'), ('x', '<u2'), ('y', '<u2'), ('p', 'V2147483000')]", 1),
        ("nested.npy", "(" * 5000 + "'<i8'" + ")" * 5000, 1),
    ):
        text = head.format(descr=descr, count=count).encode()
        files[name] = folder / name
        files[name].write_bytes(b"\x93NUMPY\x02\x00" + struct.pack("<I", len(text)) + text + bytes(1000))
    for name, content in (
        ("columns.csv", ",".join(f"c{k}" for k in range(200_000)) + "\n"),
        ("twice.csv", "t,x,y,p,t\n1,1,1,1,1\n"),
        ("digits.csv", "t,x,y,p\n" + "9" * 5000 + ",1,1,1\n"),
        ("huge.csv", "t,x,y,p\n9.9e300,1,1,1\n"),
        ("size.raw", "% evt 3.0\n% format EVT3;height=" + "9" * 5000 + ";width=5\n% end\n"),
        ("unicode.raw", "% evt 3.0\n% geometry \u00b2x\u00b3\n% end\n"),
        ("head.raw", "% a b\n" * 100_000),
        ("version.dat", "% version " + "9" * 5000 + "\n% end\n"),
        ("size.es", "Event Stream\2\0\0\1" + "\xff" * 200_000),
    ):
        files[name] = folder / name
        files[name].write_bytes(content.encode("latin-1"))
