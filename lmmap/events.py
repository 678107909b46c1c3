"""Windows of events and their histograms."""

from __future__ import annotations

import numpy as np

from .core import PAPER


def windows(events, count: int = PAPER.events_per_window) -> list[slice]:
    """Consecutive half-open windows of exactly ``count`` events.

    The tail of ``len(events) % count`` events that fills no window is dropped: it is
    ``events[count * len(windows(events, count)):]``.
    """
    _check_count(count)
    return [slice(i, i + count) for i in range(0, len(events) - count + 1, count)]


def windows_before(events, t_us, count: int = PAPER.events_per_window) -> list[slice | None]:
    """For each time, the window of the last ``count`` events strictly before it.

    None where fewer than ``count`` events have come yet.  Windows overlap if the times are close.

    Parameters
    ----------
    events : (M,) EVENT, sorted by ``t_us``
    t_us : (N,) int
    """
    _check_count(count)
    stops = np.searchsorted(events["t_us"], np.asarray(t_us), side="left").tolist()
    return [slice(stop - count, stop) if stop >= count else None for stop in stops]


def histogram(x, y, size_px: tuple[int, int]) -> np.ndarray:
    """Events per pixel whatever their polarity, shape (height, width), uint16 (saturating).

    Parameters
    ----------
    x, y : (M,) int
        Columns and rows.
    size_px : (width, height)

    Raises
    ------
    ValueError
        If a coordinate lies outside the image.
    """
    width, height = size_px
    x, y = np.asarray(x), np.asarray(y)
    for name, value, size in (("x", x, width), ("y", y, height)):
        if value.size and not (value.min() >= 0 and value.max() < size):
            raise ValueError(f"{name}: expected [0, {size}), got [{value.min()}, {value.max()}]")
    index = y.astype(np.intp) * width + x
    counts = np.bincount(index, minlength=width * height).reshape(height, width)
    return np.minimum(counts, np.iinfo(np.uint16).max).astype(np.uint16)


def _check_count(count: int) -> None:
    if count < 1:
        raise ValueError(f"count: expected at least 1, got {count}")
