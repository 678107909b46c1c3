"""Folders for unfinished work: ours hold a mark of what they were made of.

A folder without a mark is somebody else's, and is left alone.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from lmmap.errors import InputError
from lmmap.files import atomic, regular_file, temporary, writes
from lmmap.marks import MAX_BYTES

MARK = "made-of"  # in a folder of unfinished work


def has_mark(path, mark: str) -> bool:
    """Whether the file of a mark is there and holds this one."""
    return os.path.isfile(path) and regular_file(path, MAX_BYTES).read_bytes() == mark.encode()


def is_own(folder) -> bool:
    """Whether this name is free or a folder of ours has it."""
    return not os.path.lexists(folder) or (not os.path.islink(folder) and os.path.isfile(Path(folder, MARK)))


def check_own(folder) -> None:
    """`InputError` if something that is no folder of ours has this name."""
    if not is_own(folder):
        raise InputError(f"{folder}: is not ours to replace; move it away, or give another output")


def begin_folder(folder, mark: str) -> None:
    """Make a folder for unfinished work, in place of one of ours; raises `InputError`."""
    check_own(folder)
    remove_folder(folder)
    with atomic(folder) as new:
        new.mkdir()
        (new / MARK).write_text(mark)


def remove_folder(folder) -> None:
    """Remove a folder of ours; what a kill leaves of it has a temporary name, which the next run removes."""
    with temporary(folder) as gone, writes(folder), suppress(FileNotFoundError):
        os.replace(folder, gone)
