"""Recordings as streams: events in chunks and frames one by one, however long the file.

A reader gives a `Source`, the file's values as they are.  A `Stream` adds camera and truth, and checks every
chunk: no later code has to check whether time runs forward or coordinates lie on the sensor.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial, wraps
from pathlib import Path
from typing import Any, Protocol, cast

import numpy as np

from .. import plugins
from ..types import Camera, InputError, Recording, Trajectory, concatenate_events
from .order import checked_events, checked_frames, timely_events, timely_frames

CHUNK = 250_000  # events: enough to forget the cost of a call, few enough to stay in a cache


class Guess(Protocol):
    """Times whose unit a file does not state: the likeliest unit, and why it may be another, in words."""

    unit: str

    def doubt(self, size_px: tuple[int, int] | None) -> str | None: ...


def nothing() -> Iterator:
    """No events, or no frames."""
    return iter(())


@dataclass(frozen=True)
class Source:
    """What a reader found in a file.

    ``events()`` yields chunks (M,) EVENT in the file's order, ``frames()`` yields ``(t_us, (H, W, 3) u8)``;
    each call starts anew, and both raise `InputError` for what cannot be read.  ``size_px`` and ``span_us``
    (first and last time) are None if the file does not state them.  ``details()`` is what else it states: its
    encoding, its topics, its frames' ``exposure_ms``.  ``cameras()`` are its own calibrations by name, in its
    own form; ``topics`` name its streams; ``guessed`` describes times whose unit it does not state.
    """

    path: Path
    size_px: tuple[int, int] | None = None
    events: Callable[[], Iterator[np.ndarray]] = nothing
    frames: Callable[[], Iterator[tuple[int, np.ndarray]]] = nothing
    span_us: tuple[int, int] | None = None
    details: Callable[[], dict] = dict
    cameras: Callable[[], dict[str, dict]] = dict
    topics: tuple[str, ...] = ()
    guessed: Guess | None = None


@dataclass(frozen=True)
class Stream:
    """One camera's recording, read while it is used: it yields what a `Recording` holds.

    ``camera`` is None if there is no calibration and none was needed; such a stream is unchecked.
    """

    name: str
    camera: Camera  # or None, if unchecked
    source: Source
    truth: Trajectory | None = None
    checked: bool = True  # False: values as they are, to count their faults
    flips: Mapping[str, str] = field(default_factory=dict)  # by modality, as readers name them

    def chunks(self) -> Iterator[np.ndarray]:
        """Yield chunks (M,) EVENT in time order; raises `InputError` at the first fault."""
        if not self.checked:
            return self._with_file_name(timely_events(self.source.events()))
        chunks = checked_events(self.source.events(), self.camera.size_px, str(self.source.path))
        if flip := self.flips.get("event"):
            flipped = plugins.needed("flip_events", self.source.path)
            chunks = (flipped(chunk, flip, self.camera.size_px) for chunk in chunks)
        return self._with_file_name(chunks)

    def timed_frames(self) -> Iterator[tuple[int, np.ndarray]]:
        """Yield ``(t_us, (H, W, 3) u8)`` in time order; raises `InputError` at the first fault."""
        eight_bit = plugins.reader("depth")  # of 16 bits a value, as no camera of ours writes
        path, frames = self.source.path, cast(Any, self.source.frames)
        frames = timely_frames(eight_bit(path, frames) if eight_bit else frames())
        frames = checked_frames(frames, self.camera.size_px) if self.checked else frames
        if flip := self.flips.get("rgb"):
            flipped = plugins.needed("flip_frame", path)
            frames = ((t_us, flipped(frame, flip)) for t_us, frame in frames)
        return self._with_file_name(frames)

    def _with_file_name(self, values: Iterator) -> Iterator:
        try:
            yield from values
        except ValueError as error:
            raise InputError(f"{self.source.path}: {error}") from None

    def collect(self) -> Recording:
        """Read the whole recording into memory; raises `InputError` at the first fault."""
        events = concatenate_events(self.chunks())
        timed = list(self.timed_frames())
        width, height = self.camera.size_px
        frames = np.array([frame for _, frame in timed], np.uint8).reshape(-1, height, width, 3)
        frames_t_us = np.array([t_us for t_us, _ in timed], np.int64)
        if not len(events) and not len(frames):
            raise InputError(f"{self.source.path}: holds neither events nor frames; record again")
        for array in (events, frames, frames_t_us):
            array.setflags(write=False)
        return Recording(self.name, self.camera, events, frames, frames_t_us, self.truth)


Errors = tuple[type[Exception], ...]
DAMAGE: Errors = (OSError, EOFError, ValueError, OverflowError, MemoryError, struct.error)


@contextmanager
def input_errors(path: Path, problem: str, remedy: str, errors: Errors = ()):
    """Turn what damaged bytes raise in a reader into an `InputError` of one line.

    Parameters
    ----------
    problem, remedy
        What is wrong with the file as a whole, and what to do about it.
    errors
        What the format's library raises besides `DAMAGE`.  Other errors are ours and propagate.
    """
    try:
        yield
    except (*DAMAGE, *errors) as error:
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0][:300]
        raise InputError(f"{path}: {problem} ({reason}); {remedy}") from None


def reader(problem: str, remedy: str, errors: Errors = ()):
    """Decorate a function from a path to a `Source`, or to None for what another reader can read.

    Errors from damaged bytes, in it and later in the source's events, frames and details, become
    `input_errors`.
    """

    def decorate(read: Callable[..., Source | None]) -> Callable[..., Source | None]:
        @wraps(read)
        def read_safely(path: Path, *options, **named) -> Source | None:
            def value(function: Callable):
                with input_errors(path, problem, remedy, errors):
                    return function()

            def values(function: Callable[[], Iterator]) -> Iterator:
                with input_errors(path, problem, remedy, errors):
                    yield from function()

            source = value(partial(read, path, *options, **named))
            if source is None:
                return None
            streams = {name: partial(values, getattr(source, name)) for name in ("events", "frames")}
            others = {name: partial(value, getattr(source, name)) for name in ("details", "cameras")}
            return replace(source, **streams, **others)

        return read_safely

    return decorate


def in_chunks(batches: Iterable[np.ndarray], count: int = CHUNK) -> Iterator[np.ndarray]:
    """Yield the same events in chunks of at least ``count``, except the last: files hold small packets.

    If the batches end in an error, the events before it are yielded first.
    """
    waiting, size = [], 0
    try:
        for batch in batches:
            waiting.append(batch)
            size += len(batch)
            if size >= count:
                yield concatenate_events(waiting) if waiting[1:] else batch
                waiting, size = [], 0
    except Exception:
        if size:
            yield concatenate_events(waiting)
        raise
    if size:
        yield concatenate_events(waiting)


def pieces(array: np.ndarray, count: int) -> Iterator[np.ndarray]:
    """Yield an array in pieces of at most ``count``."""
    return (array[i : i + count] for i in range(0, len(array), count))
