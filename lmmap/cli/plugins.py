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
    found = {}
    for folder in filter(os.path.isdir, sys.path):
        for name in sorted(n for n in os.listdir(folder) if n.endswith(".dist-info")):
            with (
                suppress(OSError, UnicodeDecodeError),
                open(f"{folder}/{name}/entry_points.txt", "rb") as file,
            ):
                found = _entries(file.read().decode(), group) | found  # of two installations the first counts
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
        Where it is another package's, and something that it imports is missing; ``what`` needs it.
    """
    module, _, name = function.partition(":")
    try:
        return getattr(importlib.import_module(module), name)(*arguments)
    except ModuleNotFoundError as error:
        if module.startswith("lmmap.") or "." in error.name:  # a mistake of ours
            raise
        raise NotInstalled(f"{what}: needs {error.name}, which is not installed; {INSTALL}") from None


def refuse(a) -> None:
    """What a command does whose words could not be imported."""
    raise a.reason
