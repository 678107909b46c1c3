"""Arrays of events: their type, and functions that make, join and check them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from .checks import MAX_TIME_US

EVENT = np.dtype([("t_us", "<i8"), ("x", "<i2"), ("y", "<i2"), ("p", "?")], align=True)
COORDINATE = np.iinfo(EVENT["x"])


def event_array(t, x, y, p, *, offset_us: int = 0) -> np.ndarray:
    """Make events (M,) EVENT from four columns as foreign formats hold them, without sorting.

    Parameters
    ----------
    t
        Times (M,) in microseconds, whole numbers of any type.
    x, y
        Columns and rows (M,).
    p
        Polarities (M,), {0, 1} or {-1, 1}.
    offset_us
        Added to every time.

    Raises
    ------
    ValueError
        If the columns differ in length, a value is not finite or not representable, or a polarity is invalid.
    """
    t, x, y, p = (np.asarray(a) for a in (t, x, y, p))
    if not t.shape == x.shape == y.shape == p.shape or t.ndim != 1:
        raise ValueError(f"events: expected columns of one length, got {[a.shape for a in (t, x, y, p)]}")
    events = np.zeros(len(t), EVENT)
    if not len(t):
        return events
    (t0, t1), *spans, (p0, p1) = ((a.min().item(), a.max().item()) for a in (t, x, y, p))
    if not np.all(np.isfinite([t0, t1, *np.ravel(spans), p0, p1])):  # NaN passes through min and max
        raise ValueError("events: a value is not finite")
    if max(-t0, t1) + abs(offset_us) > MAX_TIME_US:
        raise ValueError("events: a time does not fit 64 bit of microseconds")
    if min(map(min, spans)) < COORDINATE.min or max(map(max, spans)) > COORDINATE.max:
        raise ValueError("events: a coordinate does not fit 16 bit")
    signed = p0 < 0
    if p0 < -1 or p1 > 1 or (p.dtype.kind not in "bu" and not np.all((p == 1) | (p == -int(signed)))):
        raise ValueError("events: expected polarities {0, 1} or {-1, 1}")
    events["t_us"] = t.astype(np.int64) + offset_us
    events["x"], events["y"], events["p"] = x, y, p > 0
    return events


def check_events(events) -> np.ndarray:
    """Return the events unchanged; raises ValueError unless they are an array (M,) EVENT."""
    if not isinstance(events, np.ndarray) or events.dtype != EVENT or events.ndim != 1:
        got = f"{events.shape} {events.dtype}" if isinstance(events, np.ndarray) else f"{events!r:.40}"
        remedy = "make them with lmmap.types.event_array"
        raise ValueError(f"events: expected an array (M,) of t_us, x, y and p, got {got}; {remedy}")
    return events


def concatenate_events(chunks: Iterable[np.ndarray]) -> np.ndarray:
    """Join chunks (M,) EVENT into one array, as opaque bytes, which numpy copies 6 times faster than fields.

    Raises
    ------
    ValueError
        If a chunk is not an array of events.
    """
    packed = (np.ascontiguousarray(check_events(chunk)).view("V16") for chunk in chunks)
    return np.concatenate([np.zeros(0, "V16"), *packed]).view(EVENT)


def on_sensor(events: np.ndarray, size_px: tuple[int, int]) -> np.ndarray:
    """Which events (M,) EVENT lie on a sensor of (width, height), shape (M,)."""
    # as unsigned numbers, negative coordinates are large ones
    x, y = (events[name].astype(np.uint16) for name in ("x", "y"))
    return (x < size_px[0]) & (y < size_px[1])
