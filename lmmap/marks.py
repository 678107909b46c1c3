"""Marks: what an unfinished or a kept result was made of, so that only the same work goes on with it.

A folder of ours for unfinished work holds a mark.  One without it is somebody else's, and is left alone.
"""

from __future__ import annotations

import json
import os
from contextlib import suppress
from pathlib import Path

from .documents import read_json
from .errors import InputError
from .files import atomic, read_text, regular_file, temporary, writes

MARK = "made-of"  # in a folder of unfinished work
MAX_BYTES = 2**24


def has_mark(path, mark: str) -> bool:
    """Whether the file of a mark is there and holds this one."""
    return os.path.isfile(path) and regular_file(path, MAX_BYTES).read_bytes() == mark.encode()


def check_mark(path, mark, made_of: dict) -> None:
    """`InputError` unless the file of a mark says that an unfinished output was made of the same."""
    try:
        before = read_json(read_text(mark, MAX_BYTES))
    except (InputError, ValueError):
        raise InputError(
            f"{path}: nothing beside it says what it was made of ({Path(mark).name}), so "
            "it cannot be resumed; give another name, or --overwrite to replace it"
        ) from None
    check_same(path, before, made_of)


def check_same(path, before, made_of: dict) -> None:
    """`InputError` that names what differs, unless a mark's values are those of ``made_of``."""
    now = json.loads(json.dumps(made_of))
    if not isinstance(before, dict) or before != now:
        keys = sorted(set(now) | set(before)) if isinstance(before, dict) else []
        differing = [key for key in keys if before.get(key) != now.get(key)]
        raise InputError(
            f"{path}: was made with another {' and '.join(differing) or 'version'}; give the "
            "same recording and settings, or another name for the output"
        )


def check_own(folder) -> None:
    """`InputError` if something that is no folder of ours has this name."""
    if os.path.lexists(folder) and (os.path.islink(folder) or not os.path.isfile(Path(folder, MARK))):
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


def as_mark(made_of: dict) -> str:
    """The text of a mark."""
    return json.dumps(made_of, indent=1, sort_keys=True) + "\n"
