"""Windows of events and their histograms."""

from __future__ import annotations

import numpy as np

from .core import EVENT, PAPER


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


def from_columns(t, x, y, p, *, seconds: bool = False, offset_us: int = 0) -> np.ndarray:
    """Events (M,) EVENT of four columns as foreign formats hold them, unsorted as they are.

    Parameters
    ----------
    t
        Times (M,), in microseconds, or in seconds where ``seconds``; rounded to microseconds.
    x, y
        Columns and rows (M,).
    p
        Polarities (M,), {0, 1} or {-1, 1}.
    offset_us
        Added to every time.

    Raises
    ------
    ValueError
        For columns of different length, values that are not finite or not representable, other polarities.
    """
    t, x, y, p = (np.asarray(a) for a in (t, x, y, p))
    if not t.shape == x.shape == y.shape == p.shape or t.ndim != 1:
        raise ValueError(
            f"events: expected columns of one length, got {t.shape}, {x.shape}, {y.shape}, {p.shape}"
        )
    if not all(np.all(np.isfinite(a)) for a in (t, x, y, p)):
        raise ValueError("events: a value is not finite")
    if t.size and max(-float(t.min()), float(t.max())) * (1e6 if seconds else 1) + abs(offset_us) > 2**62:
        raise ValueError("events: a time does not fit 64 bit of microseconds")
    if t.size and max(int(np.abs(a.astype(np.int64)).max()) for a in (x, y)) > 32_767:
        raise ValueError("events: a coordinate does not fit 16 bit")
    if not (np.all((p == 0) | (p == 1)) or np.all((p == -1) | (p == 1))):
        raise ValueError("events: expected polarities {0, 1} or {-1, 1}")
    events = np.zeros(len(t), EVENT)
    events["t_us"] = (np.rint(t * 1e6) if seconds else t).astype(np.int64) + offset_us
    events["x"], events["y"], events["p"] = x, y, p > 0
    return events
