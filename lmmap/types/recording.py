"""Events and frames of one camera: in memory, or as any stream with the same interface."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from .camera import Camera
from .checks import check_fields, frozen_times
from .events import check_events
from .pose import Trajectory

CHUNK_EVENTS = 1_000_000


@dataclass(frozen=True)
class Recording:
    """One camera's recording: ``events (M,) EVENT`` sorted by time, ``frames (N, H, W, 3)`` u8 RGB at
    ``frames_t_us (N,)`` (middle of the exposure), and the true trajectory if it is known.

    Raises
    ------
    ValueError
        If a field has another type, or there are not as many times as frames.

    Examples
    --------
    >>> frames = np.zeros((2, 260, 346, 3), np.uint8)
    >>> events = np.zeros(0, EVENT)
    >>> recording = lmmap.Recording("dark", lmmap.Camera.davis346(), events, frames, [0, 50_000])
    >>> [t_us for t_us, frame in recording.timed_frames()]
    [0, 50000]
    """

    name: str
    camera: Camera
    events: np.ndarray
    frames: np.ndarray
    frames_t_us: np.ndarray
    truth: Trajectory | None = None

    def __post_init__(self):
        object.__setattr__(self, "frames_t_us", frozen_times("frames_t_us", self.frames_t_us))
        check_fields(self)
        check_events(self.events)
        if self.frames_t_us.shape != self.frames.shape[:1] or self.frames_t_us.ndim != 1:
            got = f"times {self.frames_t_us.shape} and frames {self.frames.shape}"
            raise ValueError(f"frames, frames_t_us: expected as many times as frames (N, H, W, 3), got {got}")

    def chunks(self):
        """Yield views of at most `CHUNK_EVENTS` events, so that joining them into windows copies no more."""
        for start in range(0, max(len(self.events), 1), CHUNK_EVENTS):
            yield self.events[start : start + CHUNK_EVENTS]

    def timed_frames(self):
        """Yield ``(t_us, frame)``, each frame (H, W, 3) u8."""
        yield from zip(self.frames_t_us.tolist(), self.frames, strict=True)


@runtime_checkable
class AnyRecording(Protocol):
    """What a `Recording` in memory and a stream from a file have in common: chunks (M,) EVENT and
    ``(t_us, (H, W, 3) u8)``, both in time order."""

    @property
    def name(self) -> str: ...
    @property
    def camera(self) -> Camera: ...
    @property
    def truth(self) -> Trajectory | None: ...
    def chunks(self) -> Iterator[np.ndarray]: ...
    def timed_frames(self) -> Iterator[tuple[int, np.ndarray]]: ...
