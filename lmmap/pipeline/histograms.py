"""Windows of events and their histograms."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral

import numpy as np
from numpy.typing import ArrayLike

from ..settings import OURS, PAPER
from ..types import check_events, check_number, checked


@checked
def windows(events: np.ndarray, count: int = PAPER.events_per_window) -> list[slice]:
    """Consecutive half-open windows of exactly ``count`` events.

    The last ``len(events) % count`` events, which fill no window, are dropped: they are
    ``events[count * len(windows(events, count)):]``.  Raises ValueError unless ``events`` are (M,) EVENT and
    ``count`` is at least 1.
    """
    check_events(events)
    check_count(count)
    return [slice(i, i + count) for i in range(0, len(events) - count + 1, count)]


@checked
def windows_before(
    events: np.ndarray, t_us: Sequence[int] | np.ndarray, count: int = PAPER.events_per_window
) -> list[slice | None]:
    """For each time, the window of the last ``count`` events strictly before it.

    None if fewer than ``count`` events have come by then.  Windows overlap if the times are close.

    Parameters
    ----------
    events : (M,) EVENT, sorted by ``t_us``
    t_us : (N,) int

    Raises
    ------
    ValueError
        If the events or times have another type, or ``count`` is below 1.
    """
    check_events(events)
    check_count(count)
    if np.ndim(t_us) != 1:
        raise ValueError(f"t_us: expected times (N,), got {t_us!r:.60}")
    stops = np.searchsorted(events["t_us"], t_us, side="left").tolist()
    return [slice(stop - count, stop) if stop >= count else None for stop in stops]


@checked
def histogram(x: ArrayLike, y: ArrayLike, size_px: tuple[int, int]) -> np.ndarray:
    """Events per pixel, regardless of polarity, shape (height, width), uint16 (saturating).

    Parameters
    ----------
    x, y : (M,) int
        Columns and rows.
    size_px : (width, height)

    Raises
    ------
    ValueError
        If a coordinate lies outside the image, or the shapes of x and y differ.
    """
    width, height = size_px
    x, y = np.asarray(x), np.asarray(y)
    if x.shape != y.shape or x.ndim != 1:
        raise ValueError(f"x, y: expected coordinates (M,) each, got {x.shape} and {y.shape}")
    for name, value, size in (("x", x, width), ("y", y, height)):
        if value.size and not (value.min() >= 0 and value.max() < size):
            raise ValueError(f"{name}: expected [0, {size}), got [{value.min()}, {value.max()}]")
    index = y.astype(np.intp) * width + x
    counts = np.bincount(index, minlength=width * height).reshape(height, width)
    return np.minimum(counts, np.iinfo(np.uint16).max).astype(np.uint16)


@checked
def middle_us(events: np.ndarray) -> int:
    """Midpoint (us) of the span of events (M,), the time of their histogram; ValueError if M is zero."""
    if not len(check_events(events)):
        raise ValueError("events: expected at least one, got none")
    return (int(events["t_us"][0]) + int(events["t_us"][-1])) // 2


@checked
def window_histograms(
    events: np.ndarray,
    count: int,
    size_px: tuple[int, int],
    after_us: int | None = None,
    factor: float = OURS.second_look_factor,
) -> list[tuple]:
    """``(t_us, histogram)`` of the last ``count`` of a window's events and, if the window holds them and its
    time is after ``after_us``, of the last ``factor`` times as many.

    A histogram's time is the midpoint of its events' span.  Raises ValueError as `windows`.
    """
    check_events(events)
    check_count(count)
    check_number("factor", factor, 1, 1e6)
    timed: list[tuple] = []
    for number in dict.fromkeys((count, int(factor * count))):
        window = events[-number:]
        t_us = middle_us(window) if number <= len(events) else None
        if t_us is not None and (not timed or after_us is None or t_us > after_us):
            timed.append((t_us, histogram(window["x"], window["y"], size_px)))
    return timed


def check_count(count: int) -> None:
    """Raise ValueError unless ``count`` is a whole number of at least 1."""
    if isinstance(count, bool) or not isinstance(count, Integral) or count < 1:
        raise ValueError(f"count: expected at least 1, and a whole number, got {count!r:.40}")
