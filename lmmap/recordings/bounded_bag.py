"""The library's reader of ROS 1 bags, with limits: damaged or hostile sizes cost no memory."""

from __future__ import annotations

import io
import os
from bz2 import BZ2Decompressor
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

from lz4.frame import LZ4FrameDecompressor
from rosbags.rosbag1 import Reader, ReaderError
from rosbags.rosbag1.reader import Chunk, Header, RecordType, read_uint32

from .limits import MAX_CHUNK_BYTES

DECOMPRESSORS = {"none": None, "bz2": BZ2Decompressor, "lz4": LZ4FrameDecompressor}


class BoundedReader(Reader):
    """The library's reader, with limits on what it reads at once and on what a chunk decompresses to."""

    bio: BinaryIO  # while it is open
    path: Any  # the library's type, or our `BoundedPath`

    def open(self) -> None:
        self._size = os.path.getsize(self.path)
        self.path = BoundedPath(self.path)
        super().open()

    def read_chunk(self) -> Chunk:
        header = Header.read(self.bio, RecordType.CHUNK)
        kind, size = header.get_string("compression"), header.get_uint32("size")
        datasize = read_uint32(self.bio)
        datapos = self.bio.tell()
        if kind not in DECOMPRESSORS:
            raise ReaderError(f"Compression {kind!r} is not supported.")
        if max(size, datasize) > MAX_CHUNK_BYTES or datapos + datasize > self._size:
            raise ReaderError(f"A chunk of {max(size, datasize)} bytes.")
        self.bio.seek(datasize, os.SEEK_CUR)
        return Chunk(datasize, datapos, partial(_decompress, DECOMPRESSORS[kind], size))


class BoundedPath:
    """A path whose file refuses to read more at once than any record holds."""

    def __init__(self, path: Path):
        self._path = path

    def __str__(self) -> str:
        return str(self._path)

    def open(self, mode: str) -> io.BufferedReader:
        return _BoundedFile(io.FileIO(self._path, mode))


class _BoundedFile(io.BufferedReader):
    def read(self, size: int | None = -1) -> bytes:
        if (size or 0) > MAX_CHUNK_BYTES:
            raise ReaderError(f"A record of {size} bytes.")
        return super().read(size)


def _decompress(decompressor, size: int, content: bytes) -> bytes:
    """A chunk's bytes; ValueError where they are not as many as its header states."""
    if decompressor is not None:
        inflate = decompressor()
        content = inflate.decompress(content, max_length=size + 1)
    if len(content) != size:
        raise ValueError(f"a chunk that does not decompress to its {size} bytes")
    return content
