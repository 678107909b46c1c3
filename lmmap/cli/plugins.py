"""What other packages add to the ``lmmap`` command: named by entry points, and imported when it is needed."""

from __future__ import annotations

import importlib
import os
import sys
from contextlib import suppress

from ..files import InputError

COMMANDS, TRUTHS = "lmmap.commands", "lmmap.truths"  # groups of entry points
INSTALL = "pip install 'lmmap[lab]'"  # the laboratory of the book, which uses both groups


class NotInstalled(InputError):
    """A package that a function needs is not installed; the message says which, and how to install it."""


def entry_points(group: str) -> dict[str, str]:
    """``module:function`` by name of each entry point of a group, among all packages that are installed.

    Their files are read here: to import `importlib.metadata` takes as long as all the rest of ``--help``.
    """
    places, found = {}, {}
    for folder in sys.path:
        _, names, _ = next(os.walk(folder), ("", [], []))  # none of what is no folder, or is not readable
        for name in (name for name in names if name.endswith(".dist-info")):  # the first of a package counts
            places.setdefault(name.partition("-")[0].lower(), os.path.join(folder, name, "entry_points.txt"))
    for path in places.values():
        with suppress(OSError, ValueError), open(path, encoding="utf-8") as file:
            found |= _entries(file.read(), group)
    return dict(sorted(found.items()))


def _entries(text: str, group: str) -> dict[str, str]:
    section = f"\n{text}".partition(f"\n[{group}]\n")[2].partition("\n[")[0]
    lines = (line.partition("=") for line in section.splitlines() if "=" in line)
    return {name.strip(): value.strip() for name, _, value in lines}


def call(what: str, function: str, *arguments):
    """The value of a function that is named as ``module:function``, imported now.

    Raises
    ------
    NotInstalled
        Where it is another package's, and it or something that it imports is missing; ``what`` needs it.
    """
    module, _, name = function.partition(":")
    try:
        found = getattr(importlib.import_module(module), name, None)
        if found is not None:
            return found(*arguments)
        missing = function  # of another version, whose entry point is still there
    except ModuleNotFoundError as error:
        if module.startswith("lmmap.") or "." in error.name:  # a mistake of ours
            raise
        missing = error.name
    raise NotInstalled(f"{what}: needs {missing}, which is not installed; {INSTALL}")


def refuse(a) -> None:
    """What a command does whose words could not be imported."""
    raise a.reason
