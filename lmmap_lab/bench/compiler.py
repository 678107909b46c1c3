"""The compiler of the bench's kernels, and where it caches them.

A kernel inlines functions of other files, and numba dates its cache by one file only.  A cache folder for
each state of the bench's source means that no kernel outlives an edit.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path

import numba

from lmmap.geometry import compiled


def _cache_folder() -> Path:
    """A folder named by the bench's source."""
    bench = Path(__file__).parent
    source = b"".join(path.read_bytes() for path in sorted(bench.glob("*.py")))
    return bench / "__pycache__" / hashlib.sha256(source).hexdigest()[:16]


CACHE = os.environ.get("NUMBA_CACHE_DIR") or str(_cache_folder())


def njit(**options) -> Callable:
    """As `compiled.njit`, cached in the bench's own folder; that of others' kernels stays where it is."""

    def compile_cached(function):
        others, numba.config.CACHE_DIR = numba.config.CACHE_DIR, CACHE
        try:
            return compiled.njit(**options)(function)
        finally:
            numba.config.CACHE_DIR = others

    return compile_cached
