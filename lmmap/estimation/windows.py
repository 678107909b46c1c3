"""Cut a stream of events into windows, independently of its chunks."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator

import numpy as np

from ..pipeline.histograms import check_count, windows_before
from ..settings import PAPER
from ..tracking.fusion import LEAST_HZ, MOST_HZ
from ..types import EVENT, check_number, concatenate_events

LONG_GAP_S = 10.0  # a longer time without events is worth a warning
FEW = 1000  # images from one chunk; up to this number we never warn


def windows_of(
    chunks: Iterable[np.ndarray], count: int = PAPER.events_per_window, times: int = 1
) -> Iterator[np.ndarray]:
    """Yield `histograms.windows` of a stream: exactly ``count`` new events at a time, preceded by older ones
    up to ``times * count`` events in all."""
    check_count(count)
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
    """Yield `histograms.windows_before` of a stream at ticks of ``rate_hz`` between its first and last event,
    each preceded by older events up to ``times * count`` in all.

    Ticks with no new event since the previous one are skipped, so a gap takes no time however long it is.
    Warns of the first gap over `LONG_GAP_S`, and if there are nearly as many images as events.
    """
    check_count(count)
    check_number("rate_hz", rate_hz, LEAST_HZ, MOST_HZ)
    recent, tick, first_us, warned, dense = np.zeros(0, EVENT), 1, None, False, False
    for chunk in chunks:
        if not len(chunk):
            continue
        first_us = int(chunk["t_us"][0]) if first_us is None else first_us
        recent = concatenate_events([recent, chunk])
        last_us = recent["t_us"][-1]
        if not dense and _images(chunk["t_us"] - first_us, rate_hz) > max(len(chunk) / 2, FEW):
            dense = True
            text = "are about as many as the events; each shares nearly all of its events with the one before"
            warnings.warn(f"{rate_hz:g} images a second {text}", stacklevel=2)
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
                              "continuing after the gap", stacklevel=2)  # fmt: skip
        # the next tick is not before the last event
        recent = recent[max(0, np.searchsorted(recent["t_us"], last_us) - times * count) :]


def _images(after_us: np.ndarray, rate_hz: float) -> int:
    """Count the ticks, from 0 us on, that have a new event among the sorted times (M,); up to `FEW`, return
    an upper bound instead."""
    per_us = rate_hz / 1e6
    if (bound := int((after_us[-1] - after_us[0]) * per_us) + 1) <= FEW:
        return bound
    return int(np.count_nonzero(np.diff(np.floor(after_us * per_us))))


def _first_tick_after(elapsed_us: int, tick: int, rate_hz: float) -> int:
    """The first tick from ``tick`` on that is more than ``elapsed_us`` after the first event."""
    tick = max(tick, int(elapsed_us * rate_hz / 1e6) - 1)
    while int(tick * 1e6 / rate_hz) <= elapsed_us:
        tick += 1
    return tick
