"""Numba's compiler; its output is cached for later processes if there is a folder with room for it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import numba


def njit(**options) -> Callable:
    """Make a decorator: `numba.njit` with these options.

    Numba itself refuses to compile if no cache folder is writable (another user's package, a read-only home),
    and fails on a full disk; in these cases the function is compiled anew in each process.
    """

    def compiled(function):
        try:
            dispatcher = numba.njit(cache=True, **options)(function)
        except RuntimeError as error:
            if "cannot cache" not in str(error):
                raise
            return numba.njit(**options)(function)
        save = dispatcher._cache.save_overload

        def save_where_there_is_room(*overload):
            with suppress(OSError):
                save(*overload)

        dispatcher._cache.save_overload = save_where_there_is_room
        return dispatcher

    return compiled
