"""Events in the order of time.

Drivers now and then stamp a few events early or late, or hand packets over that overlap; those are left out
or sorted, and counted.  A clock that was set back is an error.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator

import numpy as np

from ..types import concatenate_events
from .limits import check_times

SORTED_US = 10_000  # events so far out of order are sorted: more than packets overlap
SORTED, LEFT_OUT = 0.1, 0.01  # largest share of events that are sorted, and, farther out of order, left out
LAST = 100  # events out of order at the end of what was read: more are a clock that was set back


def in_order(chunks: Iterable[np.ndarray], name: str | None = None) -> Iterator[np.ndarray]:
    """Pass chunks (M,) EVENT on; ValueError, with a remedy, where time runs backward.

    With a ``name``, that of the recording, a few events out of order are sorted or left out, and a warning at
    the end counts them.  A chunk waits for the next, which tells such events from a clock that was set back.
    """
    mender, held, is_sound = _Mender(name), None, True
    try:
        for chunk in chunks:
            if not len(chunk):
                continue
            check_times(chunk["t_us"][[0, -1]])  # in order, as is checked next, those between them are too
            if held is not None and is_sound and held["t_us"][-1] <= chunk["t_us"][0]:
                yield mender.passed(held)
            elif held is not None:
                both = mender.mend(concatenate_events([held, chunk]))
                cut = max(len(both) - len(chunk), 0)
                yield mender.passed(both[:cut])
                chunk = both[cut:]
            held, is_sound = chunk, _is_sorted(chunk)
        if not is_sound:
            held, is_sound = mender.mend(held), True
    except Exception:  # what was read before an error comes before it
        if held is not None and is_sound:
            yield held
        raise
    if held is not None:
        yield held
    mender.tell()


def _is_sorted(e: np.ndarray) -> bool:
    return not np.any(e["t_us"][1:] < e["t_us"][:-1])


class _Mender:
    """Puts runs of events in order, and counts what that took."""

    def __init__(self, name: str | None):
        self._name, self._before, self._last_us = name, 0, -(2**63)
        self._sorted = self._left_out = self._farthest_us = 0

    def passed(self, e: np.ndarray) -> np.ndarray:
        """The same events, which the next ones follow."""
        if len(e):
            self._before, self._last_us = self._before + len(e), int(e["t_us"][-1])
        return e

    def mend(self, e: np.ndarray) -> np.ndarray:
        """Events (M,) in order; ValueError unless only a few of them are far out of it."""
        t_us = e["t_us"]
        check_times(t_us)
        early_us = np.maximum.accumulate(t_us) - t_us
        late_us = t_us - np.minimum.accumulate(t_us[::-1])[::-1]
        off_us = min(early_us, late_us, key=lambda off_us: np.count_nonzero(off_us > SORTED_US))
        far = off_us > SORTED_US
        rest = e[~far]
        still_us = np.maximum.accumulate(rest["t_us"]) - rest["t_us"]
        few = far.mean() <= LEFT_OUT and (off_us > 0).mean() <= SORTED and np.argmin(off_us[::-1] > 0) <= LAST
        if self._name is None or not few or still_us.max() > SORTED_US:
            raise ValueError(self._fault(t_us))
        after = rest["t_us"] >= self._last_us  # others come too late to be sorted
        self._sorted += np.count_nonzero(still_us[after])
        self._left_out += len(e) - np.count_nonzero(after)
        self._farthest_us = max(self._farthest_us, int(off_us.max()))
        return rest[after][np.argsort(rest["t_us"][after], kind="stable")]

    def _fault(self, t_us: np.ndarray) -> str:
        steps = np.flatnonzero(t_us[1:] < t_us[:-1])
        by_us, number = t_us[steps[0]] - t_us[steps[0] + 1], self._before + steps[0]
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
