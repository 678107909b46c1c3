"""Checks of arguments from outside: every message names the argument, what was expected and what came."""

from __future__ import annotations

import inspect
import typing
from collections import abc
from dataclasses import fields
from functools import cache, wraps
from importlib import import_module
from numbers import Real
from types import UnionType
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from .arrays import frozen_array

MAX_TIME_US = 2**60  # either way: 36 000 years; sums and differences of such times fit 64 bits


def check_number(name: str, value, low: float, high: float) -> None:
    """Raise ValueError unless the value is a number from ``low`` to ``high``."""
    if not _lies_within(value, low, high):
        raise ValueError(f"{name}: expected a number from {low:g} to {high:g}, got {value!r:.40}")


def check_time(name: str, t_us) -> None:
    """Raise ValueError unless the value is a time that fits 64 bits of microseconds."""
    if not _lies_within(t_us, -MAX_TIME_US, MAX_TIME_US):
        raise ValueError(f"{name}: expected a time that fits 64 bits of microseconds, got {t_us!r:.40}")


def _lies_within(value, low: float, high: float) -> bool:
    return not isinstance(value, bool) and isinstance(value, Real) and low <= cast(float, value) <= high


def frozen_times(name: str, t_us) -> np.ndarray:
    """A read-only copy (N,) i64 of times in microseconds; raises ValueError if one is not a time."""
    if not _is_numeric(t_us):
        raise ValueError(f"{name}: expected times that fit 64 bits of microseconds, got {t_us!r:.60}")
    times = np.asarray(t_us)
    if times.size:
        for bound in (times.min(), times.max()):  # NaN is both
            check_time(name, bound)
    return frozen_array(times, np.int64)


def checked(function):
    """Decorate a public function to check each argument against its annotation; raises ValueError."""
    parameters = inspect.signature(function).parameters.values()
    single = [p.name for p in parameters if p.kind == p.POSITIONAL_OR_KEYWORD]
    many = [p.name for p in parameters if p.kind == p.VAR_POSITIONAL]

    @wraps(function)
    def with_checks(*args, **named):
        hints = _hints(function)
        for name, value in [*zip([*single, *many * len(args)], args, strict=False), *named.items()]:
            if name in hints:
                _check(name, value, hints[name], function)
        return function(*args, **named)

    return with_checks


def check_fields(instance) -> None:
    """Raise ValueError unless each field of a dataclass matches its annotation."""
    hints = _hints(type(instance))
    for field in fields(instance):
        _check(field.name, getattr(instance, field.name), hints[field.name], type(instance))


_hints: abc.Callable[[object], dict[str, Any]] = cache(typing.get_type_hints)


def _check(name: str, value, hint, of) -> None:
    if not _is(value, hint):
        raise ValueError(f"{name}: expected {of.__annotations__[name]}, got {value!r:.60}")


def _is(value, hint) -> bool:
    """Whether a value is what an annotation says, as far as that can be seen without using it up."""
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if hint is ArrayLike:
        return _is_numeric(value)
    if origin in (typing.Union, UnionType):
        return any(_is(value, one) for one in inner)
    if hint in (int, float):
        long = isinstance(value, int) and value.bit_length() > 64  # beyond what arrays hold
        return isinstance(value, Real) and not isinstance(value, bool) and not long
    if origin is tuple and inner[-1] is not ...:
        alike = isinstance(value, tuple | list) and len(value) == len(inner)
        return alike and all(map(_is, value, inner))
    if origin in (tuple, list, abc.Sequence):
        kinds = (tuple, list) if origin is tuple else origin
        return isinstance(value, kinds) and all(_is(one, inner[0]) for one in value)
    return isinstance(value, origin or hint)


def _is_numeric(value) -> bool:
    try:
        return np.asarray(value).dtype.kind in "biuf"
    except (TypeError, ValueError):  # such as lists of different lengths
        return False


def camera_files():
    """Import the module that reads and writes cameras and ports.

    That module imports this package, so it is imported only when ``load`` or ``save`` is called.
    """
    return import_module("lmmap.camera_files")
