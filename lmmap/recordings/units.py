"""Units of event times: what a file that names none is taken to have, and whether a sensor can have it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

NANOSECONDS = {"s": 10**9, "sec": 10**9, "seconds": 10**9, "ms": 10**6, "us": 1000, "ns": 1,
               "µs": 1000, "μs": 1000}  # fmt: skip
UNITS = ("s", "ms", "us", "ns")
FEWEST = 100  # events to judge by
QUIETEST_HZ, LOUDEST_HZ = 1000, 500  # of a sensor, and of a pixel; a DAVIS 346 can have 130
LONG_S = 10.0  # so few events may come, but not for so long


class Guessed(NamedTuple):
    """Times whose unit nothing states: as what they are taken, some of them (N,), how many events there are,
    and the time (us) that they take."""

    unit: str
    some_us: np.ndarray
    count: int
    span_us: int

    @classmethod
    def of(cls, some: np.ndarray, count: int, ends: np.ndarray) -> Guessed:
        """Of some times (N,) as they are stored, how many there are, and the first and last of all (2,)."""
        start_us, end_us = microseconds(ends, None)
        return cls(unit_of(some), microseconds(some, None), count, int(end_us) - int(start_us))

    def doubt(self, size_px: tuple[int, int] | None) -> str | None:
        """Why the unit is another, in words; None where nothing speaks against it."""
        seconds = max(self.span_us, 1) * 1e-6
        rate_hz, pixels = self.count / seconds, size_px[0] * size_px[1] if size_px else 10**6
        quiet = self.count >= FEWEST and seconds > LONG_S and rate_hz < QUIETEST_HZ
        if quiet or (self.count >= 10 * FEWEST and rate_hz > LOUDEST_HZ * pixels):
            seen_hz = {u: rate_hz * NANOSECONDS[self.unit] / NANOSECONDS[u] for u in UNITS}
            others = [u for u, hz in seen_hz.items() if QUIETEST_HZ <= hz <= LOUDEST_HZ * pixels]
            as_what = f"if they are in {' or '.join(others)}, give --time-unit {others[-1]}" if others else ""
            return f"no sensor has {rate_hz:.3g} events/s for {seconds:.3g} s; {as_what or 'check them'}"
        rounded = self.count >= FEWEST and self.span_us > 0 and not np.any(self.some_us % 1000)
        if self.unit == "us" and rounded and 1000 * rate_hz <= LOUDEST_HZ * pixels:
            return "all are multiples of 1000; if they are in ns, give --time-unit ns"
        return None


def unit_of(t: np.ndarray) -> str:
    """The unit of times that state none: of whole numbers us, of others s."""
    return "s" if t.dtype.kind == "f" else "us"


def microseconds(t: np.ndarray, unit: str | None) -> np.ndarray:
    """Times (N,) in microseconds, of whole numbers exactly, rounded where they have more digits; ValueError
    where they are no numbers or do not fit."""
    if t.dtype.kind not in "iuf":
        raise ValueError(f"times of type {t.dtype}")
    unit_ns = NANOSECONDS[unit or unit_of(t)]
    if t.dtype.kind == "f":
        with np.errstate(over="ignore"):
            return np.rint(t * (unit_ns / 1000))
    if unit_ns == 1000:
        return t
    if len(t) and max(-int(t.min()), int(t.max())) > 2**62 // max(unit_ns // 1000, 1):
        raise ValueError("a time does not fit 64 bit of microseconds")
    t = t.astype(np.int64)
    return t * (unit_ns // 1000) if unit_ns > 1000 else (t + 500) // 1000
