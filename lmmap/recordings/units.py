"""Units of event times: what a file that names none is taken to have, and whether a sensor can have it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

NANOSECONDS = {"s": 10**9, "sec": 10**9, "seconds": 10**9, "ms": 10**6, "us": 1000, "ns": 1,
               "µs": 1000, "μs": 1000}  # fmt: skip
UNITS = ("s", "ms", "us", "ns")
FEWEST, LONG_S = 100, 10.0  # events to judge by; so long no sensor is quieter than the next number
QUIETEST_HZ, LOUDEST_HZ = 1000, 500  # of a sensor, and of a pixel; a DAVIS 346 can have 130
RUN = 20_000  # events: of a file's ends


class Guessed(NamedTuple):
    """Times whose unit nothing states: as what they are taken, and pieces (N,) of them in microseconds."""

    unit: str
    pieces_us: list[np.ndarray]

    @classmethod
    def of(cls, *runs: np.ndarray) -> Guessed | None:
        """Of runs (N,) of a file's times as they are stored; None of too few to judge by."""
        pieces = [piece for run in runs for piece in np.array_split(run, min(len(run) // FEWEST, 20) or 1)]
        known = [microseconds(piece, None) for piece in pieces if len(piece) >= FEWEST]
        return cls(unit_of(runs[0]), known) if known else None

    def doubt(self, size_px: tuple[int, int] | None) -> str | None:
        """Why the unit is another, in words; None where nothing speaks against it."""
        spans_us = [max(int(t[-1]) - int(t[0]), 1) for t in self.pieces_us]
        lengths = [len(t) for t in self.pieces_us]
        rate_hz = float(np.median(np.divide(lengths, spans_us))) * 1e6  # whatever a jump of the clock
        loudest_hz = LOUDEST_HZ * (size_px[0] * size_px[1] if size_px else 10**6)
        quiet = rate_hz < QUIETEST_HZ and sum(spans_us) > LONG_S * 1e6
        if quiet or (rate_hz > loudest_hz and sum(lengths) >= 10 * FEWEST):
            rates_hz = {unit: rate_hz * NANOSECONDS[self.unit] / NANOSECONDS[unit] for unit in UNITS}
            others = " or ".join(u for u, hz in rates_hz.items() if QUIETEST_HZ <= hz <= loudest_hz)
            remedy = f"if they are in {others}, give --time-unit {others}" if others else "check them"
            return f"no sensor has {rate_hz:.3g} events/s for so long; {remedy}"
        whole = all(t[-1] > t[0] and not np.any(t[:: len(t) // FEWEST] % 1000) for t in self.pieces_us)
        if self.unit == "us" and whole and 1000 * rate_hz <= loudest_hz:
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
