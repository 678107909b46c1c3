"""Events in the order of time.

Drivers now and then stamp a few events early or late, or hand packets over that overlap; those are left out
or sorted, and counted.  A clock that was set back is an error.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator

import numpy as np

from .limits import MAX_TIME_US, check_times

SORTED_US = 10_000  # events so far out of order are sorted: more than packets overlap
SORTED, LEFT_OUT = 0.1, 0.01  # largest share of events that are sorted, and, farther out of order, left out
LAST = 100  # events out of order at the end of a chunk: more are a clock that was set back


def in_order(chunks: Iterable[np.ndarray], name: str | None = None) -> Iterator[np.ndarray]:
    """Pass chunks (M,) EVENT on; ValueError, with a remedy, where time runs backward.

    With a ``name``, that of the recording, a few events out of order are sorted or, far out of it or earlier
    than the last chunk, left out; a warning at the end counts them.
    """
    mender = _Mender(name)
    for chunk in chunks:
        if len(chunk):
            yield mender.passed(chunk)
    mender.tell()


class _Mender:
    """Puts chunks of events in order, and counts what that took."""

    def __init__(self, name: str | None):
        self._name, self._before, self._last_us = name, 0, -MAX_TIME_US
        self._sorted = self._left_out = self._farthest_us = 0

    def passed(self, e: np.ndarray) -> np.ndarray:
        """Events (M,) in order, behind those before; ValueError unless only a few are far out of it."""
        t_us = e["t_us"]
        check_times(t_us[[0, -1]])  # in order, as is checked next, those between them are too
        self._before += len(e)
        if t_us[0] < self._last_us or np.any(t_us[1:] < t_us[:-1]):
            e = self._mended(e)
        self._last_us = int(e["t_us"][-1])
        return e

    def _mended(self, e: np.ndarray) -> np.ndarray:
        t_us = e["t_us"]
        check_times(t_us)
        before_us = self._last_us - t_us
        early_us = np.maximum(np.maximum.accumulate(t_us) - t_us, before_us)
        late_us = np.maximum(t_us - np.minimum.accumulate(t_us[::-1])[::-1], before_us)
        off_us = min(early_us, late_us, key=lambda off_us: np.count_nonzero(off_us > SORTED_US))
        far = off_us > SORTED_US
        few = far.mean() <= LEFT_OUT and (off_us > 0).mean() <= SORTED and np.argmin(off_us[::-1] > 0) <= LAST
        rest = e[~far & (before_us <= 0)]
        still_us = np.maximum.accumulate(rest["t_us"]) - rest["t_us"]
        if self._name is None or not few or still_us.max(initial=0) > SORTED_US:
            raise ValueError(self._fault(t_us))
        self._sorted += np.count_nonzero(still_us)
        self._left_out += len(e) - len(rest)
        self._farthest_us = max(self._farthest_us, int(off_us.max()))
        return rest[np.argsort(rest["t_us"], kind="stable")]

    def _fault(self, t_us: np.ndarray) -> str:
        since_us = np.diff(t_us, prepend=self._last_us)
        steps = np.flatnonzero(since_us < 0)
        by_us, number = -since_us[steps[0]], self._before - len(t_us) + steps[0] - 1
        remedy = "the clock was set back, so cut the recording there"
        if len(steps) > 1:
            remedy = f"{len(steps)} such steps are too many, so write the events in the order of time"
        text = f"time of the events runs backward by {by_us} us after number {number}"
        return f"{text}; {remedy} ('lmmap info' counts such faults)"

    def tell(self) -> None:
        """A warning that counts what was sorted and left out."""
        counts = {"left out": self._left_out, "sorted": self._sorted}
        if done := " and ".join(f"{n} {what}" for what, n in counts.items() if n):
            text = f"events up to {self._farthest_us} us out of the order of time: {done}"
            warnings.warn(f"{self._name}: {text}", stacklevel=2)
