"""What other packages add to lmmap: named by entry points, and imported when it is needed."""

from __future__ import annotations

import importlib
from argparse import Namespace
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from .errors import InputError

READERS = "lmmap.readers"  # of other programs' formats: by the end of a file's name, or by what they do
COMMANDS, TRUTHS, NETWORKS, VIEWS = "lmmap.commands", "lmmap.truths", "lmmap.networks", "lmmap.views"
INSTALL = "pip install 'lmmap[lab]'"  # the laboratory of the book, which uses all other groups


class NotInstalled(InputError):
    """A package that a function needs is not installed; the message says which, and how to install it."""


def entry_points(group: str) -> dict[str, str]:
    """``module:function`` by name of each entry point of a group, among all packages that are installed."""
    return {point.name: point.value for point in sorted(metadata.entry_points(group=group))}


def version() -> str | None:
    """The installed version of lmmap, if it is installed."""
    try:
        return metadata.version("lmmap")
    except metadata.PackageNotFoundError:
        return None


@cache
def reader(name: str) -> Any:
    """What readers of other programs' formats do under a name, imported now; None where none has it."""
    if name not in (points := entry_points(READERS)):
        return None
    module, _, function = points[name].partition(":")
    try:
        return getattr(importlib.import_module(module), function)
    except ModuleNotFoundError as error:
        raise NotInstalled(f"{name}: needs {error.name}, which is not installed; pip install lmmap") from None


def needed(name: str, what: str | Path) -> Any:
    """As `reader`, but `NotInstalled`, which says ``what`` needs it, where none has it."""
    if (found := reader(name)) is None:
        raise NotInstalled(f"{what}: needs lmmap_readers, which is not installed; pip install lmmap")
    return found


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
        missing = error.name or function  # whoever raised it need not name a module
        if module.startswith("lmmap.") or "." in (error.name or ""):  # a mistake of ours
            raise
    raise NotInstalled(f"{what}: needs {missing}, which is not installed; {INSTALL}")


def first(what: str, group: str, *arguments):
    """As `call`, of the function that a group's first entry point names."""
    for function in entry_points(group).values():
        return call(what, function, *arguments)
    raise NotInstalled(f"{what}: needs the laboratory of the book; {INSTALL}")


def refuse(a: Namespace) -> None:
    """What a command does whose words could not be imported."""
    raise a.reason
