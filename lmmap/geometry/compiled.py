"""Numba's compiler; what it makes is kept for the next process where there is a folder and room for it."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import numba


def njit(**options) -> Callable:
    """A decorator, `numba.njit` with these options.

    Numba itself refuses to compile where no folder for what it keeps may be written (a package of another
    user's, a home that is read-only), and fails on a full disk; here it is compiled anew in each process.
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
