"""Where the bench's compiled kernels are cached.

A kernel inlines functions of other files, and numba dates its cache by one file only.  A cache folder for
each state of the bench's source means that no kernel outlives an edit.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import numba

if "NUMBA_CACHE_DIR" not in os.environ:
    folder = Path(__file__).parent
    source = b"".join(path.read_bytes() for path in sorted(folder.glob("*.py")))
    numba.config.CACHE_DIR = str(folder / "__pycache__" / hashlib.sha256(source).hexdigest()[:16])

njit = numba.njit
