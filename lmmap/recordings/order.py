"""Checks of events and frames as they pass: in time order and on the sensor, or an error with a remedy."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from .. import plugins
from ..types import on_sensor
from .limits import MAX_TIME_US, check_times


def in_order(chunks: Iterable[np.ndarray], name: str | None = None) -> Iterator[np.ndarray]:
    """Pass chunks (M,) EVENT on; raises ValueError, with a remedy, if time runs backward.

    With the recording's ``name``, a few events out of order are put in order if lmmap_readers is installed.
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
    """Say where times (N,), after ``before`` others up to ``last_us``, run backward, and what to do."""
    since_us = np.diff(t_us, prepend=last_us)
    steps = np.flatnonzero(since_us < 0)
    by_us, number = -since_us[steps[0]], before + steps[0] - 1
    remedy = "the clock was set back, so cut the recording there"
    if len(steps) > 1:
        remedy = f"{len(steps)} such steps are too many, so write the events in the order of time"
    text = f"time of the events runs backward by {by_us} us after number {number}"
    return f"{text}; {remedy} ('lmmap info' counts such faults)"


def timely_events(chunks: Iterable[np.ndarray]) -> Iterator[np.ndarray]:
    """Pass on chunks that hold events; raises ValueError at a time that no clock shows."""
    for chunk in chunks:
        if len(chunk):
            check_times(chunk["t_us"])
            yield chunk


def timely_frames(frames: Iterable) -> Iterator[tuple[int, np.ndarray]]:
    """Pass ``(t_us, frame)`` on; raises ValueError at a time that no clock shows."""
    for t_us, frame in frames:
        check_times(t_us)
        yield t_us, frame


def checked_events(
    chunks: Iterable[np.ndarray], size_px: tuple[int, int], name: str | None = None
) -> Iterator[np.ndarray]:
    """Pass chunks on, `in_order`; raises ValueError, with a remedy, if an event lies outside the sensor."""
    return in_order(_on_sensor(chunks, size_px), name)


def _on_sensor(chunks: Iterable[np.ndarray], size_px: tuple[int, int]) -> Iterator[np.ndarray]:
    before = 0
    for e in chunks:
        if len(outside := np.flatnonzero(~on_sensor(e, size_px))):
            k = outside[0]
            raise ValueError(
                f"event outside {size_px[0]} x {size_px[1]} px, number {before + k} at ({e['x'][k]}, "
                f"{e['y'][k]}); check the sensor's size and the order of x and y"
            )
        before += len(e)
        yield e


def checked_frames(frames: Iterable, size_px: tuple[int, int]) -> Iterator[tuple[int, np.ndarray]]:
    """Pass ``(t_us, frame)`` on; raises ValueError, with a remedy, if time runs back or a size differs."""
    last_us, shape = None, (size_px[1], size_px[0], 3)
    for k, (t_us, frame) in enumerate(frames):
        if frame.shape != shape or frame.dtype != np.uint8:
            got = f"{frame.shape} {frame.dtype}"
            raise ValueError(f"frame number {k} of shape {got}, expected {shape} uint8; write it again")
        if last_us is not None and t_us < last_us:
            raise ValueError(
                f"time of the frames runs backward by {last_us - t_us} us after number {k - 1}; "
                "sort by time, or cut the recording there ('lmmap info' counts such faults)"
            )
        last_us = t_us
        yield t_us, frame
