"""Marks record what an unfinished or kept result was made from, so that only the same job continues it."""

from __future__ import annotations

import json
from pathlib import Path

from .documents import read_json
from .errors import InputError
from .files import read_text

MAX_BYTES = 2**24


def check_mark(path, mark, made_of: dict) -> None:
    """Raise `InputError` unless a mark's file says that an unfinished output was made from the same."""
    try:
        before = read_json(read_text(mark, MAX_BYTES))
    except (InputError, ValueError):
        raise InputError(
            f"{path}: nothing beside it says what it was made of ({Path(mark).name}), so "
            "it cannot be resumed; give another name, or --overwrite to replace it"
        ) from None
    check_same(path, before, made_of)


def check_same(path, before, made_of: dict) -> None:
    """Raise an `InputError` that names what differs, unless a mark's values are those of ``made_of``."""
    now = json.loads(json.dumps(made_of))
    if not isinstance(before, dict) or before != now:
        keys = sorted(set(now) | set(before)) if isinstance(before, dict) else []
        differing = [key for key in keys if before.get(key) != now.get(key)]
        raise InputError(
            f"{path}: was made with another {' and '.join(differing) or 'version'}; give the "
            "same recording and settings, or another name for the output"
        )


def as_mark(made_of: dict) -> str:
    """The text of a mark."""
    return json.dumps(made_of, indent=1, sort_keys=True) + "\n"
