"""Numbers from outside, checked: every message names the argument, what was expected and what came."""

from __future__ import annotations

from numbers import Real

import numpy as np

from .arrays import frozen_array

MAX_TIME_US = 2**60  # either way: 36 000 years; sums and differences of such times fit 64 bits


def check_number(name: str, value, low: float, high: float) -> None:
    """ValueError unless the value is a number from ``low`` to ``high``."""
    if isinstance(value, bool) or not isinstance(value, Real) or not low <= value <= high:
        raise ValueError(f"{name}: expected a number from {low:g} to {high:g}, got {value!r:.40}")


def check_time(name: str, t_us) -> None:
    """ValueError unless the value is a time that fits 64 bits of microseconds."""
    if isinstance(t_us, bool) or not isinstance(t_us, Real) or not -MAX_TIME_US <= t_us <= MAX_TIME_US:
        raise ValueError(f"{name}: expected a time that fits 64 bits of microseconds, got {t_us!r:.40}")


def frozen_times(name: str, t_us) -> np.ndarray:
    """A read-only copy (N,) i64 of times; ValueError where one is none."""
    times = np.asarray(t_us)
    if times.size:
        if times.dtype.kind not in "iuf":
            raise ValueError(f"{name}: expected times that fit 64 bits of microseconds, got {times.dtype}")
        for bound in (times.min(), times.max()):  # NaN is both
            check_time(name, bound)
    return frozen_array(times, np.int64)
