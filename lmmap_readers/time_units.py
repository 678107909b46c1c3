"""Units of times: which one is assumed if a file states none, and whether it suits images."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lmmap.recordings.formats import UNITS

NANOSECONDS = {"s": 10**9, "sec": 10**9, "seconds": 10**9, "ms": 10**6, "us": 1000, "ns": 1,
               "µs": 1000, "μs": 1000}  # fmt: skip
IMAGE_STEP_S = 1e-4, 10.0  # between the images of a camera


class GuessedSteps(NamedTuple):
    """Times of images whose unit is not stated: the unit assumed, and the typical step between them (s)."""

    unit: str
    step_s: float

    @classmethod
    def of(cls, t: np.ndarray) -> GuessedSteps | None:
        """Make one from times (N,) as they are stored; None for fewer than two."""
        if len(t) < 2:
            return None
        step_us = np.abs(np.diff(microseconds(t, None)))
        return cls(unit_of(t), float(np.median(step_us) or np.mean(step_us)) * 1e-6)

    def doubt(self, _) -> str | None:
        """Why the unit is probably another, in words; None if nothing speaks against it."""
        if IMAGE_STEP_S[0] <= self.step_s < IMAGE_STEP_S[1]:
            return None
        others = likely_units(self.step_s, self.unit, *IMAGE_STEP_S)
        remedy = f"if they are in {others}, give --time-unit {others}" if others else "check them"
        return f"its images are then {self.step_s:.3g} s apart; {remedy}"


def likely_units(step_s: float, own: str, least_s: float, most_s: float) -> str:
    """The units in which a step, ``step_s`` long in the unit ``own``, would be a likely one, in words."""
    steps_s = {unit: step_s * NANOSECONDS[unit] / NANOSECONDS[own] for unit in UNITS}
    return " or ".join(unit for unit, s in steps_s.items() if least_s <= s < most_s)


def unit_of(t: np.ndarray) -> str:
    """The unit assumed for times that state none: us for whole numbers, s for others."""
    return "s" if t.dtype.kind == "f" else "us"


def microseconds(t: np.ndarray, unit: str | None) -> np.ndarray:
    """Convert times (N,) to microseconds, whole numbers exactly, and round those with more digits; raises
    ValueError if they are not numbers or do not fit."""
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
