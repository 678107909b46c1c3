"""Files: refused unless regular and of a declared size, written whole or not at all, and marked for resuming.

A mark is a short text that says what a result was made of.  A result is kept for as long as its mark is that
of what would make it now.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import stat
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # options of mallopt, from malloc.h

CAMERA = "camera.json"  # the calibration that a folder of bags shares


class InputError(Exception):
    """Bad input from outside: the message names the file, the problem and the remedy."""

    def _render_traceback_(self) -> list[str]:
        """What a notebook shows: the message alone, as on the command line."""
        return [f"InputError: {self}"]


def regular_file(path, max_bytes: int | None = None) -> Path:
    """The path of a regular file of at most ``max_bytes``; raises `InputError`.

    Devices and pipes are refused because reading them may never end.
    """
    path = Path(path)
    try:
        facts = os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        raise InputError(f"{path}: no such file; check the path") from None
    except (OSError, ValueError) as error:  # a name that is too long or holds a zero byte
        raise InputError(f"{path}: cannot open ({error}); check the path") from None
    if not stat.S_ISREG(facts.st_mode):
        kind = "a folder" if stat.S_ISDIR(facts.st_mode) else "a device or a pipe"
        raise InputError(f"{path}: is {kind}, not a file; name a file on a disk")
    if max_bytes is not None and facts.st_size > max_bytes:
        raise InputError(f"{path}: has {facts.st_size} bytes, more than {max_bytes}; name the right file")
    return path


def read_text(path, max_bytes: int) -> str:
    """A text file of at most ``max_bytes``; raises `InputError`."""
    path = regular_file(path, max_bytes)
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is not text in UTF-8"
        raise InputError(f"{path}: cannot read this file ({reason}); name a text file") from None


@contextmanager
def atomic(path) -> Iterator[Path]:
    """A temporary path beside ``path`` for a file or a folder, renamed to ``path`` when the block succeeds.

    After any error nothing remains of it.  Folders above ``path`` have to be there.

    Raises
    ------
    InputError
        In place of an `OSError`, such as a full disk or a missing permission.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        raise InputError(
            f"{path}: cannot write ({error.strerror or error}); choose a folder with room that you may write"
        ) from None
    finally:
        if temporary.is_dir():
            shutil.rmtree(temporary, ignore_errors=True)
        with suppress(OSError):  # where the folder itself is missing, nothing was written
            temporary.unlink(missing_ok=True)


def write_text(path, text: str) -> Path:
    """Write a text file, whole or not at all, and make its folder where it is missing."""
    path = Path(path)
    with atomic(path) as temporary:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.write_text(text)
    return path


def has_mark(path, mark: str) -> bool:
    """Whether the file of a mark is there and holds this one."""
    path = Path(path)
    return path.exists() and path.read_text() == mark


def check_folder_of(path) -> None:
    """`InputError` unless the folder of an output is there."""
    path = Path(path)
    if not path.parent.is_dir():
        raise InputError(f"{path}: no folder {path.parent}; make it first")


def check_output(path, inputs: Iterable = (), *, overwrite: bool = False) -> Path:
    """The path of an output that may be written: a new file, or with ``overwrite`` one that is no input.

    Raises
    ------
    InputError
        Where it cannot be written, or where something would be lost.
    """
    check_folder_of(path)
    path = Path(path)
    folder = path.parent
    if path.is_dir():
        raise InputError(f"{path}: is a folder; give the name of a file")
    if not os.access(path if path.exists() else folder, os.W_OK):
        raise InputError(f"{path}: cannot write there; choose a folder that you may write")
    if not path.exists() or not path.is_file():  # what is written to a device replaces nothing
        return path
    for source in filter(None, inputs):
        source = Path(source)
        if source.exists() and (path.samefile(source) or (source.is_dir() and folder.samefile(source))):
            raise InputError(f"{path}: is also read as {source}; give the output another name")
    if not overwrite:
        raise InputError(f"{path}: exists; give another name, or --overwrite to replace it")
    return path


@contextmanager
def lock(path) -> Iterator[None]:
    """Keep other processes from writing to ``path``; the system frees it when the process ends, however.

    Raises
    ------
    InputError
        If another process holds it.
    """
    try:
        import fcntl
    except ImportError:  # Windows has no such locks
        yield
        return
    path = Path(path)
    name = path.with_name(f".{path.name}.lock")
    while True:
        try:
            descriptor = os.open(name, os.O_RDWR | os.O_CREAT, 0o644)
        except OSError as error:
            raise InputError(
                f"{path}: cannot write there ({error.strerror}); choose a folder that you may write"
            ) from None
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(descriptor)
            raise InputError(f"{path}: another process writes it; wait, or give another name") from None
        with suppress(OSError):
            if os.path.samestat(os.fstat(descriptor), os.stat(name)):
                break
        os.close(descriptor)  # its last owner removed it in between
    try:
        yield
    finally:
        with suppress(OSError):
            os.unlink(name)
        os.close(descriptor)


def beside(path, name: str) -> Path | None:
    """A file that serves a folder of bags: in a bag's folder, or in the one above."""
    folder = Path(path).resolve().parent
    return next((p / name for p in (folder, folder.parent) if (p / name).exists()), None)


def tune_allocator() -> None:
    """Have glibc keep the networks' large buffers for the rest of this process; the command and the study
    call it when they start.

    Given back at each free and faulted in anew page by page, the buffers cost a fifth of the time.  Other
    allocators are left as they are.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt:
        for option, size in ((M_MMAP_THRESHOLD, 64 << 20), (M_TRIM_THRESHOLD, 256 << 20)):
            mallopt(option, size)
