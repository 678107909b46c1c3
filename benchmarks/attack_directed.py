"""Files that each violate their format in one way: bombs, devices, absurd counts, sizes and times."""

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path

import cv2
import h5py
import numpy as np
from attack_bags import directed_bags, directed_ros2

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
    directed_bags(files, folder)
    directed_ros2(files, folder)
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
    """A deflated stream of at least ``count`` zeros, made of equal blocks; its checksum is wrong."""
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
