"""Events in the order of time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from .. import plugins
from .limits import MAX_TIME_US, check_times


def in_order(chunks: Iterable[np.ndarray], name: str | None = None) -> Iterator[np.ndarray]:
    """Pass chunks (M,) EVENT on; ValueError, with a remedy, where time runs backward.

    With a ``name``, that of the recording, the readers of other programs' formats, where they are installed,
    put a few events in order.
    """
    before, last_us, mender = 0, -MAX_TIME_US, None
    for e in chunks:
        if not len(e):
            continue
        t_us = e["t_us"]
        check_times(t_us[[0, -1]])  # in order, as is checked next, those between them are too
        if t_us[0] < last_us or np.any(t_us[1:] < t_us[:-1]):
            check_times(t_us)
            if mender is None and name and (make := plugins.reader("order")):
                mender = make(name)
            if mender is None:
                raise ValueError(fault(t_us, last_us, before))
            e = mender.mended(e, last_us, before)
        before += len(t_us)
        last_us = int(e["t_us"][-1])
        yield e
    if mender:
        mender.tell()


def fault(t_us: np.ndarray, last_us: int, before: int) -> str:
    """Where times (N,) run backward that follow ``before`` others, up to ``last_us``, and what to do."""
    since_us = np.diff(t_us, prepend=last_us)
    steps = np.flatnonzero(since_us < 0)
    by_us, number = -since_us[steps[0]], before + steps[0] - 1
    remedy = "the clock was set back, so cut the recording there"
    if len(steps) > 1:
        remedy = f"{len(steps)} such steps are too many, so write the events in the order of time"
    text = f"time of the events runs backward by {by_us} us after number {number}"
    return f"{text}; {remedy} ('lmmap info' counts such faults)"
