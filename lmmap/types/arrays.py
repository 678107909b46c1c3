"""Arrays that no holder of a dataclass can change."""

from __future__ import annotations

import numpy as np


def frozen_array(a, dtype=float) -> np.ndarray:
    """A read-only copy, so that no holder of a dataclass can change it."""
    a = np.array(a, dtype)
    a.setflags(write=False)
    return a


def frozen_numbers(name: str, a, *last: int) -> np.ndarray:
    """`frozen_array` of shape (..., *last); raises ValueError for anything else."""
    try:
        numbers = frozen_array(a)
    except (TypeError, ValueError, OverflowError):
        numbers = None
    if numbers is None or numbers.shape[max(numbers.ndim - len(last), 0) :] != last:
        shape = ", ".join(["...", *map(str, last)])
        raise ValueError(f"{name}: expected numbers ({shape}), got {a!r:.60}")
    return numbers
