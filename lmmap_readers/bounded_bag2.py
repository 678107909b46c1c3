"""The library's reader of ROS 2 bags, with limits: damaged or hostile sizes cost no memory."""

from __future__ import annotations

from importlib.util import find_spec, module_from_spec
from pathlib import Path
from types import MappingProxyType, ModuleType, SimpleNamespace
from urllib.parse import quote

import apsw
from backports import zstd
from lz4.frame import LZ4FrameDecompressor
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader, ReaderError
from rosbags.rosbag2.reader import DirectoryReader

from lmmap.errors import InputError
from lmmap.files import regular_file
from lmmap.recordings.bounded_bag import BoundedPath
from lmmap.recordings.formats import METADATA
from lmmap.recordings.limits import MAX_CHUNK_BYTES

MAX_METADATA_BYTES = 2**17  # of a bag's description, whose parser takes 3 s; a hundred topics take 50 kB
MAX_UNPACK_RATIO = 50  # of a ROS 2 bag's file, beyond one chunk; events shrink to a third, images to a tenth


def open_bag(path: Path, typestore) -> AnyReader:
    """Make a reader for a bag's folder or one of its files, not opened yet."""
    bag = AnyReader([path], default_typestore=typestore)
    bag.readers = [BoundedBag(path)]
    return bag


def _own_copy(name: str) -> ModuleType:
    """A module of the library once more, in which we change names without changing them for others."""
    spec = find_spec(f"rosbags.rosbag2.{name}")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


_mcap, _sqlite = _own_copy("storage_mcap"), _own_copy("storage_sqlite3")


class BoundedMcap(_mcap.McapReader):
    """Reads no more at once than a chunk may hold, and refuses an index of more than its file can hold."""

    def open(self) -> None:
        path, self.path = self.path, BoundedPath(self.path)
        super().open()
        offsets = [chunk.chunk_start_offset for chunk in self.chunks]
        size = sum(chunk.uncompressed_size for chunk in self.chunks)
        if len(set(offsets)) < len(offsets) or size > _most_unpacked(path):
            self.close()
            raise ReaderError(f"An index of {len(offsets)} chunks, which unpack to {size} bytes.")


class BoundedSqlite(_sqlite.Sqlite3Reader):
    """Refuses a database whose recorder died before its last messages were in it."""

    def open(self) -> None:
        for log in (self.path.with_name(self.path.name + end) for end in ("-wal", "-journal")):
            if log.exists() and log.stat().st_size:
                remedy = f"have SQLite put them in: sqlite3 {self.path.name} vacuum"
                raise InputError(f"{self.path}: its last messages lie in {log.name} beside it; {remedy}")
        self.path = Path(quote(str(self.path.absolute())))  # the library makes a URI of it
        super().open()


class _BoundedConnection(apsw.Connection):
    """Gives out no value of more than `MAX_CHUNK_BYTES`: a column may be computed, so that a short file
    could answer with gigabytes."""

    def __init__(self, *named, **options):
        super().__init__(*named, **options)
        self.limit(apsw.SQLITE_LIMIT_LENGTH, MAX_CHUNK_BYTES)


class BoundedDirectory(DirectoryReader):
    """Reads small metadata only, and checks what compressed files and messages unpack to."""

    STORAGE_PLUGINS = MappingProxyType({"mcap": BoundedMcap, "sqlite3": BoundedSqlite})

    def open(self) -> None:
        if (size := (self.path / METADATA).stat().st_size) > MAX_METADATA_BYTES:
            raise ReaderError(f"Metadata of {size} bytes.")
        for packed in self.path.glob("*.zstd"):
            _check_unpacked(regular_file(packed))
        self.path = _Folder(self.path)
        super().open()
        self._packed = self.metadata.compression_mode == "message"
        self.metadata = self.metadata._replace(compression_mode=None)  # the library would inflate unbounded

    def messages(self, connections, start=None, stop=None):
        """Yield connection, time (ns) and bytes of each message, unpacked within limits."""
        for connection, time_ns, raw in super().messages(connections, start, stop):
            yield connection, time_ns, _inflate(zstd.ZstdDecompressor(), raw) if self._packed else raw


class _Folder:
    """A bag's folder, whose description may name each file once, and regular files only: the library opens,
    and may unpack, whatever it names as often as it does."""

    def __init__(self, path: Path):
        self._path, self._named = path, set()

    def __truediv__(self, name) -> Path:
        if str(name) in self._named:
            raise ReaderError(f"{name} is named twice.")
        self._named.add(str(name))
        return regular_file(self._path / name)


class BoundedBag(Reader):
    """The library's reader with bounded storages."""

    STORAGE_PLUGINS = MappingProxyType({"dir": BoundedDirectory, ".mcap": BoundedMcap, ".db3": BoundedSqlite})


def _most_unpacked(path: Path) -> int:
    """Bytes that a file may unpack to."""
    return MAX_CHUNK_BYTES + MAX_UNPACK_RATIO * path.stat().st_size


def _check_unpacked(path: Path) -> None:
    """ReaderError where a compressed file, which the library unpacks to disk, has too much in it."""
    size, most = 0, _most_unpacked(path)
    with path.open("rb") as file, zstd.open(file, "rb") as unpacked:
        while piece := unpacked.read(2**20):
            size += len(piece)
            if size > most:
                raise ReaderError(f"{path.name} unpacks to more than {most} bytes.")


def _inflate(decompressor, packed: bytes, size: int = MAX_CHUNK_BYTES) -> bytes:
    """What bytes unpack to; ReaderError where that is more than ``size``."""
    if size > MAX_CHUNK_BYTES:
        raise ReaderError(f"A chunk of {size} bytes.")
    content = decompressor.decompress(packed, max_length=size + 1)
    if len(content) > size:
        raise ReaderError(f"A chunk that unpacks to more than {size} bytes.")
    return content


# The library's own entries inflate without a limit; these also check what the chunk's header states.
_mcap.DECOMPRESSORS.update(
    lz4=lambda packed, size: _inflate(LZ4FrameDecompressor(), packed, size),
    zstd=lambda packed, size: _inflate(zstd.ZstdDecompressor(), packed, size),
)
_sqlite.apsw = SimpleNamespace(**vars(apsw) | {"Connection": _BoundedConnection})
