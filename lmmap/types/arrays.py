"""Arrays that no holder of a dataclass can change."""

from __future__ import annotations

import numpy as np


def frozen_array(a, dtype=float) -> np.ndarray:
    """A read-only copy, so that no holder of a dataclass can change it."""
    a = np.array(a, dtype)
    a.setflags(write=False)
    return a
