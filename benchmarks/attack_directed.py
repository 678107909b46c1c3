"""Files that each violate their format in one way: bombs, devices, absurd counts, sizes and times."""

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path

import cv2
import h5py
import numpy as np
from attack_bags import Files, directed_bags, directed_ros2

SUFFIXES = (
    *(".aedat4", ".bag", ".h5", ".txt", ".avi", ".mcap", ".db3", ".raw", ".dat", ".es", ".csv", ".npy"),
    ".png",
)


def directed_files(folder: Path) -> dict[str, Path]:
    """Files that each break one promise of their format."""
    files = Files(folder)
    for suffix in SUFFIXES:
        os.mkfifo(files.path(f"fifo{suffix}"))
        files.path(f"zero{suffix}").symlink_to("/dev/zero")
        with files.path(f"sparse{suffix}").open("wb") as file:
            file.truncate(2**33)
    with files.path("line.txt").open("wb") as file:  # one line, whose end never comes
        file.write(b"1.0 1 1 1 ")
        file.truncate(2**32)
    for name, t_us in (("gap", 3_600_000_000), ("epoch", 1_700_000_000_000_000), ("end", 2**62)):
        times_us = (k * 50 + (t_us if k > 9000 else 0) for k in range(18_000))
        lines = (b"%d %d 5 1\n" % (time_us, k % 64) for k, time_us in enumerate(times_us))
        files.path(f"{name}.txt").write_bytes(b"".join(lines))
    files.path("int64.txt").write_bytes(b"9223372036854775807 1 1 1\n" * 50)
    files.path("seconds.txt").write_bytes(b"9.9e300 1 1 1\n" * 50)
    for add in (_directed_hdf5, directed_bags, directed_ros2, _directed_tables):
        add(files)
    body = _deflated_zeros((2**16 * 3 + 1) * 2**12)
    for name, height in (("gigapixel", 2**14), ("cut", 2**12)):
        pictures = files.folder(f"{name} folder")
        (pictures / "0.png").write_bytes(_png(2**16, height, body))
        (pictures / "timestamps.txt").write_text("1.0\n")
    for name, time_text in (("huge", "9.9e300"), ("int", "9" * 30), ("nan", "nan."), ("negative", "-1.5")):
        pictures = files.folder(f"{name} times")
        cv2.imwrite(str(pictures / "0.png"), np.zeros((48, 64, 3), np.uint8))
        (pictures / "timestamps.txt").write_text(f"{time_text}\n")
    return files


def _deflated_zeros(count: int) -> bytes:
    """A deflated stream of at least ``count`` zeros, made of equal blocks; its checksum is wrong."""
    packer = zlib.compressobj(9)
    first, block = (packer.compress(bytes(2**24)) + packer.flush(zlib.Z_FULL_FLUSH) for _ in range(2))
    return first + block * (count // 2**24) + packer.flush()


def _png(width: int, height: int, body: bytes) -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", body) + chunk(b"IEND", b"")


def _directed_hdf5(files: Files) -> None:
    def columns(file, count, **layout):
        for name, dtype in (("t", "<i8"), ("x", "<u2"), ("y", "<u2"), ("p", "u1")):
            file.create_dataset(f"events/{name}", (count,), dtype, **layout)

    for name, count, layout in (
        ("never", 10**8, {"chunks": (10**6,)}),
        ("never-large", 10**12, {"chunks": (10**6,)}),
        ("never-contiguous", 10**9, {}),
        ("large-chunks", 2**31, {"chunks": (2**29,)}),
    ):
        with h5py.File(files.path(f"{name}.h5"), "w") as file:
            columns(file, count, **layout)
    with h5py.File(files.path("bomb.h5"), "w") as file:
        columns(file, 10**6, chunks=(10**6,), compression="gzip")
        bomb = _deflated_zeros(2**31)
        for name in "txyp":
            file[f"events/{name}"].id.write_direct_chunk((0,), bomb)
    with h5py.File(files.path("external.h5"), "w") as file:
        columns(file, 10, external=[("/etc/passwd", 0, h5py.h5f.UNLIMITED)])
    with h5py.File(files.path("filter.h5"), "w") as file:
        import hdf5plugin

        columns(file, 1000, chunks=(1000,), **hdf5plugin.Bitshuffle())
        for name in "txyp":
            file[f"events/{name}"][:] = 0
            file[f"events/{name}"].id.write_direct_chunk((0,), os.urandom(200))
    with h5py.File(files.path("frames.h5"), "w") as file:
        columns(file, 10)
        file.create_dataset("frames", (10**6, 48, 64, 3), "u1", chunks=(1, 48, 64, 3), compression="gzip")
        file["frames_t_us"] = np.arange(10**6)


def _directed_tables(files: Files) -> None:
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
        files.path(name).write_bytes(b"\x93NUMPY\x02\x00" + struct.pack("<I", len(text)) + text + bytes(1000))
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
        files.path(name).write_bytes(content.encode("latin-1"))
