"""How glibc's allocator treats the networks' large buffers."""

from __future__ import annotations

import ctypes
import sys

M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3  # options of mallopt, from malloc.h


def tune_allocator() -> None:
    """Have glibc keep the networks' large buffers for the rest of this process, which has to be ours: the
    command's, or a worker's.

    If they were returned at each free and faulted in again page by page, they would cost a fifth of the time.
    Other allocators are left as they are.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if mallopt:
        for option, size in ((M_MMAP_THRESHOLD, 64 << 20), (M_TRIM_THRESHOLD, 256 << 20)):
            mallopt(option, size)
