"""Extensions that other packages add to lmmap: named by entry points, imported when needed."""

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
    """Map each entry point's name to its ``module:function``, for a group over all installed packages."""
    return {point.name: point.value for point in sorted(metadata.entry_points(group=group))}


def version() -> str | None:
    """The version of the installed lmmap, or None if it is not installed."""
    try:
        return metadata.version("lmmap")
    except metadata.PackageNotFoundError:
        return None


@cache
def reader(name: str) -> Any:
    """Import and return the function that lmmap_readers registers under a name, or return None.

    Raises
    ------
    NotInstalled
        If a module that the function needs is missing.
    """
    if name not in (points := entry_points(READERS)):
        return None
    module, _, function = points[name].partition(":")
    try:
        return getattr(importlib.import_module(module), function)
    except ModuleNotFoundError as error:
        raise NotInstalled(f"{name}: needs {error.name}, which is not installed; pip install lmmap") from None


def needed(name: str, what: str | Path) -> Any:
    """As `reader`, but if it returns None, raise `NotInstalled`, which says that ``what`` needs it."""
    if (found := reader(name)) is None:
        raise NotInstalled(f"{what}: needs lmmap_readers, which is not installed; pip install lmmap")
    return found


def call(what: str, function: str, *arguments):
    """Import the function named as ``module:function``, call it and return its value.

    Raises
    ------
    NotInstalled
        If another package's function, or something that it imports, is missing; ``what`` needs it.
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
    """As `call`, for the function of a group's first entry point; `NotInstalled` if the group is empty."""
    for function in entry_points(group).values():
        return call(what, function, *arguments)
    raise NotInstalled(f"{what}: needs the laboratory of the book; {INSTALL}")


def refuse(a: Namespace) -> None:
    """Run in place of a command whose arguments could not be imported: raise the reason."""
    raise a.reason
