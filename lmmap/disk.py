"""Files beside an output while it is written: locks, and unfinished files that the next run removes."""

from __future__ import annotations

import errno
import os
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from .errors import InputError


@contextmanager
def writes(path) -> Iterator[None]:
    """Raise an `InputError` that names ``path`` in place of an `OSError`, such as a full disk."""
    try:
        yield
    except OSError as error:
        raise InputError(
            f"{path}: cannot write ({error.strerror or error}); choose a writable folder with enough room"
        ) from None


def is_special(path) -> bool:
    """Whether ``path`` is a device, a pipe or a socket: writing to it replaces nothing."""
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):
        return False
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))


def open_special(path) -> BinaryIO:
    """Open a device or a pipe for writing; raise `InputError` rather than wait for a pipe's reader."""
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_NONBLOCK)
    except OSError as error:
        if error.errno == errno.ENXIO:
            raise InputError(f"{path}: no program reads this pipe; start one first, or name a file") from None
        raise
    os.set_blocking(descriptor, True)
    return open(descriptor, "wb")


def part_of(path: Path) -> Path:
    """Path of the unfinished ``path``; only lmmap uses such names, so whatever is there may be removed."""
    return path.with_name(f".{path.stem}.lmmap{path.suffix}")


@contextmanager
def temporary(path) -> Iterator[Path]:
    """A free name beside ``path`` for an unfinished file or folder.

    Anything that a killed run left there is removed first, and anything left when the block ends as well.
    """
    path = Path(path)
    part = part_of(path)

    def remove() -> None:
        if part.is_dir():
            shutil.rmtree(part, ignore_errors=True)  # which leaves links
        with suppress(OSError):
            part.unlink()

    with lock(path, "writing"):
        remove()
        try:
            yield part
        finally:
            remove()


def tidy(path) -> None:
    """Remove what a killed run left beside a file or folder of ours."""
    with temporary(path):
        pass


def is_there(path) -> bool:
    """Whether a finished file or folder exists; if so, `tidy` it."""
    there = os.path.lexists(path)
    if there:
        tidy(path)
    return there


@contextmanager
def lock(path, kind: str = "lock") -> Iterator[None]:
    """Keep other processes from writing to ``path``; however the process ends, the system releases the lock.

    Devices and pipes are not locked, and locks of another ``kind`` are independent.

    Raises
    ------
    InputError
        If another process holds the lock.
    """
    try:
        import fcntl
    except ImportError:  # Windows has no such locks
        fcntl = None  # type: ignore[assignment]
    if fcntl is None or is_special(path):
        yield
        return
    path = Path(path)
    name = path.with_name(f".{path.name}.{kind}")
    while True:
        with writes(path):
            descriptor = os.open(name, os.O_RDWR | os.O_CREAT, 0o644)
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
