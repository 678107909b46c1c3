"""Put events in time order.

Drivers now and then stamp a few events early or late, or deliver packets that overlap; such events are sorted
or left out, and counted.  A clock that was set back is an error.
"""

from __future__ import annotations

import warnings

import numpy as np

from lmmap.recordings.order import fault

SORTED_US = 10_000  # events so far out of order are sorted: more than packets overlap
SORTED, LEFT_OUT = 0.1, 0.01  # largest share of events that are sorted, and, farther out of order, left out
LAST = 100  # events out of order at the end of a chunk: more are a clock that was set back


class Mender:
    """Sorts a few events of a recording that are out of order, or leaves them out, and counts both."""

    def __init__(self, name: str):
        self._name = name
        self._sorted = self._left_out = self._farthest_us = 0

    def mended(self, e: np.ndarray, last_us: int, before: int) -> np.ndarray:
        """Put events (M,), after ``before`` others up to ``last_us``, in order; raises ValueError unless only
        a few are far out of order."""
        t_us = e["t_us"]
        before_us = last_us - t_us
        early_us = np.maximum(np.maximum.accumulate(t_us) - t_us, before_us)
        late_us = np.maximum(t_us - np.minimum.accumulate(t_us[::-1])[::-1], before_us)
        off_us = min(early_us, late_us, key=lambda off_us: np.count_nonzero(off_us > SORTED_US))
        far = off_us > SORTED_US
        few = far.mean() <= LEFT_OUT and (off_us > 0).mean() <= SORTED and np.argmin(off_us[::-1] > 0) <= LAST
        rest = e[~far & (before_us <= 0)]
        still_us = np.maximum.accumulate(rest["t_us"]) - rest["t_us"]
        if not few or still_us.max(initial=0) > SORTED_US:
            raise ValueError(fault(t_us, last_us, before))
        self._sorted += np.count_nonzero(still_us)
        self._left_out += len(e) - len(rest)
        self._farthest_us = max(self._farthest_us, int(off_us.max()))
        return rest[np.argsort(rest["t_us"], kind="stable")]

    def tell(self) -> None:
        """Warn of the numbers of events that were sorted and left out."""
        counts = {"left out": self._left_out, "sorted": self._sorted}
        if done := " and ".join(f"{n} {what}" for what, n in counts.items() if n):
            text = f"events up to {self._farthest_us} us out of the order of time: {done}"
            warnings.warn(f"{self._name}: {text}", stacklevel=2)
