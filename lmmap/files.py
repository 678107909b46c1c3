"""Files that are written whole or not at all, and the marks by which an interrupted run goes on.

A mark is a short text that says what a result was made of.  A result is kept for as long as its mark is that
of what would make it now.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .camera_files import InputError

CAMERA = "camera.json"  # the calibration that a folder of bags shares


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


def beside(path, name: str) -> Path | None:
    """A file that serves a folder of bags: in a bag's folder, or in the one above."""
    folder = Path(path).resolve().parent
    return next((p / name for p in (folder, folder.parent) if (p / name).exists()), None)
