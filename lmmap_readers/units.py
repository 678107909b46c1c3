"""Whether a sensor can send events at the rate that the assumed unit of a file's times implies."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lmmap.recordings.formats import UNITS

from .time_units import NANOSECONDS, microseconds, unit_of

FEWEST, LONG_S = 100, 10.0  # events to judge by; so long no sensor is quieter than the next number
QUIETEST_HZ, LOUDEST_HZ = 1000, 500  # of a sensor, and of a pixel; a DAVIS 346 can have 130
RUN, PIECES = 20_000, 20  # events of a file's ends; how many pieces of each are looked at


class Guessed(NamedTuple):
    """Times whose unit is not stated: the unit assumed, the number of events (K,) and the duration (us, K) of
    pieces of the file, and whether all times are multiples of 1000."""

    unit: str
    counts: np.ndarray
    spans_us: np.ndarray
    thousands: bool

    @classmethod
    def of(cls, *runs: np.ndarray) -> Guessed | None:
        """Make one from runs (N,) of a file's times as they are stored; None if too few to judge by."""
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
        """Why the unit is probably another, in words; None if nothing speaks against it."""
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
