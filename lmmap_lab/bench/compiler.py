"""The compiler of the bench's kernels, and where it caches them.

A kernel inlines functions of other files, and numba dates its cache by one file only.  A cache folder for
each state of the bench's source means that no kernel outlives an edit.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import numba

from lmmap.geometry.compiled import njit as njit


def _cache_folder() -> Path:
    """A folder named by the bench's source."""
    bench = Path(__file__).parent
    source = b"".join(path.read_bytes() for path in sorted(bench.glob("*.py")))
    return bench / "__pycache__" / hashlib.sha256(source).hexdigest()[:16]


if "NUMBA_CACHE_DIR" not in os.environ:
    numba.config.CACHE_DIR = str(_cache_folder())
