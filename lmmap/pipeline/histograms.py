"""Windows of events and their histograms."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator

import numpy as np

from ..settings import OURS, PAPER
from ..types import EVENT, concatenate_events

LONG_GAP_S = 10.0  # without an event: longer, and it is named


def windows(events, count: int = PAPER.events_per_window) -> list[slice]:
    """Consecutive half-open windows of exactly ``count`` events.

    The tail of ``len(events) % count`` events that fills no window is dropped: it is
    ``events[count * len(windows(events, count)):]``.
    """
    _check_count(count)
    return [slice(i, i + count) for i in range(0, len(events) - count + 1, count)]


def windows_of(
    chunks: Iterable[np.ndarray], count: int = PAPER.events_per_window, times: int = 1
) -> Iterator[np.ndarray]:
    """`windows` of a stream, whatever the chunks: yields exactly ``count`` events at a time, and before them
    those that came before, up to ``times`` as many in all."""
    _check_count(count)
    recent, seen = np.zeros(0, EVENT), 0
    for chunk in chunks:
        recent = concatenate_events([recent, chunk]) if len(recent) else chunk
        for stop in range(seen + count, len(recent) + 1, count):
            yield recent[max(0, stop - times * count) : stop]
            seen = stop
        old = max(0, seen - (times - 1) * count)
        recent, seen = recent[old:], seen - old


def windows_at(
    chunks: Iterable[np.ndarray], rate_hz: float, count: int = PAPER.events_per_window, times: int = 1
) -> Iterator[np.ndarray]:
    """`windows_before` of a stream at ticks of ``rate_hz`` between its first and last event, and before
    their events those that came before, up to ``times`` as many in all.

    A tick without a new event since the one before has no window of its own and is passed over, so that a
    gap takes no time however long it is; a warning names the first of over `LONG_GAP_S`.
    """
    _check_count(count)
    recent, tick, first_us, warned = np.zeros(0, EVENT), 1, None, False
    for chunk in chunks:
        if not len(chunk):
            continue
        first_us = int(chunk["t_us"][0]) if first_us is None else first_us
        recent = concatenate_events([recent, chunk])
        last_us = recent["t_us"][-1]
        while (tick_us := first_us + int(tick * 1e6 / rate_hz)) < last_us:
            (window,) = windows_before(recent, [tick_us], count)
            if window is not None:
                yield recent[max(0, window.stop - times * count) : window.stop]
            tick += 1
            next_us = int(recent["t_us"][np.searchsorted(recent["t_us"], tick_us)])
            tick = _first_tick_after(next_us - first_us, tick, rate_hz)
            if next_us - tick_us > 1e6 * LONG_GAP_S and not warned:
                warned = True
                warnings.warn(f"no events for {(next_us - tick_us) * 1e-6:.0f} s after {tick_us} us; "
                              "going on behind the gap", stacklevel=2)  # fmt: skip
        # a coming tick is no earlier than the last event
        recent = recent[max(0, np.searchsorted(recent["t_us"], last_us) - times * count) :]


def _first_tick_after(elapsed_us: int, tick: int, rate_hz: float) -> int:
    """The first tick, not before ``tick``, that is later than a time after the first event."""
    tick = max(tick, int(elapsed_us * rate_hz / 1e6) - 1)
    while int(tick * 1e6 / rate_hz) <= elapsed_us:
        tick += 1
    return tick


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


def middle_us(events) -> int:
    """The middle of a window's span: the time of its histogram."""
    return (int(events["t_us"][0]) + int(events["t_us"][-1])) // 2


def window_histograms(
    events,
    count: int,
    size_px: tuple[int, int],
    after_us: int | None = None,
    factor: float = OURS.second_look_factor,
) -> list[tuple]:
    """``(t_us, histogram)`` of the last ``count`` of a window's events and of the last ``factor`` times as
    many, if it holds them and they lie after ``after_us``; a histogram's time is the middle of its events'
    span."""
    timed = []
    for number in dict.fromkeys((count, int(factor * count))):
        window = events[-number:]
        t_us = middle_us(window) if number <= len(events) else None
        if t_us is not None and (not timed or after_us is None or t_us > after_us):
            timed.append((t_us, histogram(window["x"], window["y"], size_px)))
    return timed


def _check_count(count: int) -> None:
    if count < 1:
        raise ValueError(f"count: expected at least 1, got {count}")
