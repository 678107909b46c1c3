"""Units of times: what a file that names none is taken to have, and whether a camera can have it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

NANOSECONDS = {"s": 10**9, "sec": 10**9, "seconds": 10**9, "ms": 10**6, "us": 1000, "ns": 1,
               "µs": 1000, "μs": 1000}  # fmt: skip
UNITS = ("s", "ms", "us", "ns")
FEWEST, LONG_S = 100, 10.0  # events to judge by; so long no sensor is quieter than the next number
QUIETEST_HZ, LOUDEST_HZ = 1000, 500  # of a sensor, and of a pixel; a DAVIS 346 can have 130
RUN, PIECES = 20_000, 20  # events of a file's ends; how many pieces of each are looked at
IMAGE_STEP_S = 1e-4, 10.0  # between the images of a camera


class Guessed(NamedTuple):
    """Times whose unit nothing states: as what they are taken, how many events pieces of the file have (K,),
    how long (us) these take (K,), and whether all times are whole thousands."""

    unit: str
    counts: np.ndarray
    spans_us: np.ndarray
    thousands: bool

    @classmethod
    def of(cls, *runs: np.ndarray) -> Guessed | None:
        """Of runs (N,) of a file's times as they are stored; None of too few to judge by."""
        runs = [run for run in runs if len(run) >= FEWEST]
        ends = [np.linspace(0, len(run) - 1, min(len(run) // FEWEST, PIECES) + 1).astype(int) for run in runs]
        edges_us = [microseconds(run[end], None) for run, end in zip(runs, ends, strict=True)]
        if not runs or not np.all(np.isfinite(np.concatenate(edges_us))):
            return None
        counts, spans_us = (
            np.concatenate([np.diff(np.asarray(v, float)) for v in values]) for values in (ends, edges_us)
        )
        some = np.concatenate([run[:: len(run) // 1000 + 1] for run in runs])
        thousands = some.dtype.kind != "f" and np.ptp(some) > 0 and not np.any(some % 1000)
        return cls(unit_of(runs[0]), counts, np.maximum(spans_us, 0), bool(thousands))

    def doubt(self, size_px: tuple[int, int] | None) -> str | None:
        """Why the unit is another, in words; None where nothing speaks against it."""
        typical_hz = float(np.median(self.counts / np.maximum(self.spans_us, 1))) * 1e6  # whatever a jump
        mean_hz = 1e6 * float(self.counts.sum() / max(self.spans_us.sum(), 1))
        loudest_hz = LOUDEST_HZ * (size_px[0] * size_px[1] if size_px else 10**6)
        quiet = typical_hz < QUIETEST_HZ and self.spans_us.sum() > LONG_S * 1e6
        rate_hz = typical_hz if quiet else mean_hz
        if quiet or (mean_hz > loudest_hz and self.counts.sum() >= 9 * FEWEST):
            rates_hz = {unit: rate_hz * NANOSECONDS[self.unit] / NANOSECONDS[unit] for unit in UNITS}
            others = " or ".join(u for u, hz in rates_hz.items() if QUIETEST_HZ <= hz <= loudest_hz)
            remedy = f"if they are in {others}, give --time-unit {others}" if others else "check them"
            return f"no sensor has {rate_hz:.3g} events/s for so long; {remedy}"
        if self.unit == "us" and self.thousands and 1000 * mean_hz <= loudest_hz:
            return "all are multiples of 1000; if they are in ns, give --time-unit ns"
        return None


class GuessedSteps(NamedTuple):
    """Times of images whose unit nothing states: as what they are taken, and how far most are apart."""

    unit: str
    step_s: float

    @classmethod
    def of(cls, t: np.ndarray) -> GuessedSteps | None:
        """Of times (N,) as they are stored; None of less than two."""
        if len(t) < 2:
            return None
        step_us = np.abs(np.diff(microseconds(t, None)))
        return cls(unit_of(t), float(np.median(step_us) or np.mean(step_us)) * 1e-6)

    def doubt(self, _) -> str | None:
        """Why the unit is another, in words; None where nothing speaks against it."""
        if IMAGE_STEP_S[0] <= self.step_s < IMAGE_STEP_S[1]:
            return None
        others = likely_units(self.step_s, self.unit, *IMAGE_STEP_S)
        remedy = f"if they are in {others}, give --time-unit {others}" if others else "check them"
        return f"its images are then {self.step_s:.3g} s apart; {remedy}"


def likely_units(step_s: float, own: str, least_s: float, most_s: float) -> str:
    """The units in which steps that are ``step_s`` in their own would be likely ones, in words."""
    steps_s = {unit: step_s * NANOSECONDS[unit] / NANOSECONDS[own] for unit in UNITS}
    return " or ".join(unit for unit, s in steps_s.items() if least_s <= s < most_s)


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
