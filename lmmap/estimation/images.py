"""Images of a recording or a device in time order: frames, or histograms of events."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from ..pipeline.histograms import window_histograms
from ..pipeline.image_estimator import settings_for
from ..settings import Settings
from ..types import EVENT, AnyRecording, concatenate_events
from .windows import windows_at, windows_of


class TimedImage(NamedTuple):
    """An image and its time; for events also the time and histogram of a wider window, or None."""

    t_us: int
    image: np.ndarray
    wider: tuple[int, np.ndarray] | None = None

    @property
    def times_us(self) -> set[int]:
        """The times (us) that an estimate from this image can have."""
        return {self.t_us} | ({self.wider[0]} if self.wider else set())


def timed_images(
    recording: AnyRecording, modality: str, settings: Settings | None = None, rate_hz: float | None = None
) -> Iterator[TimedImage]:
    """Yield the images of a recording in time order, reading it as a stream.

    For ``"rgb"`` they are the frames.  For ``"event"`` they are histograms of N events each or, at
    ``rate_hz``, of the last N events before each tick; a histogram's time is the midpoint of its events'
    span.  Once there are enough events, a wider histogram comes with it, provided that it is later than the
    previous image.  ``settings`` default to `settings_for` the recording's camera.
    """
    if modality == "rgb":
        yield from _frames(recording, rate_hz)
        return
    settings = settings or settings_for(recording.camera)
    count, factor = settings.events_per_window, settings.second_look_factor
    chunks, before_us = recording.chunks(), None
    most = math.ceil(factor)
    windows = windows_at(chunks, rate_hz, count, most) if rate_hz else windows_of(chunks, count, most)
    for window in windows:
        first, *wider = window_histograms(window, count, recording.camera.size_px, before_us, factor)
        yield TimedImage(*first, *wider)
        before_us = first[0]


def _frames(recording: AnyRecording, rate_hz: float | None) -> Iterator[TimedImage]:
    """Every frame or, at ``rate_hz``, the first frame of each period; frames may be a millisecond early."""
    period_us = 1e6 / rate_hz if rate_hz else 0
    due_us = -np.inf
    for t_us, frame in recording.timed_frames():
        if t_us >= due_us - 1000:
            due_us = max(due_us + period_us, t_us) if np.isfinite(due_us) else t_us + period_us
            yield TimedImage(int(t_us), frame)


def images(*args, **options) -> Iterator[tuple[int, np.ndarray]]:
    """Yield ``(t_us, image)`` of `timed_images`, with the same arguments."""
    return ((timed.t_us, timed.image) for timed in timed_images(*args, **options))


def newest_images(
    device,
    modality: str,
    settings: Settings,
    wait_s: float = 0.001,
    seconds: float | None = None,
    take_events: Callable[[np.ndarray], None] | None = None,
) -> Iterator[tuple[TimedImage, int, int]]:
    """Yield a device's newest frame, or a histogram of its newest N events each time N new ones have arrived,
    until the device stops or ``seconds`` have passed.  With each image come the time of its newest data (us)
    and the number of images skipped before it.

    Nothing queues: images that arrive while we are busy are skipped and counted, so on a slow machine the
    latency stays bounded.  ``settings`` give N.  ``take_events`` receives all new events (M,) before they
    become an image.
    """
    recent, fresh, before_us = np.zeros(0, EVENT), 0, None
    count, factor = settings.events_per_window, settings.second_look_factor
    began = time.monotonic()
    while device.running() and (seconds is None or time.monotonic() - began < seconds):
        if not (pending := device.pending(modality)):
            time.sleep(wait_s)
            continue
        if modality == "rgb":
            t_us, frame = pending[-1]
            yield TimedImage(t_us, frame), t_us, len(pending) - 1
            continue
        come = concatenate_events(pending)
        if take_events is not None and len(come):
            take_events(come)
        fresh += len(come)
        recent = concatenate_events([recent, come])[-math.ceil(factor) * count :]
        if fresh < count:
            time.sleep(wait_s)
            continue
        skipped, fresh = fresh // count - 1, 0
        first, *wider = window_histograms(recent, count, device.size_px, before_us, factor)
        before_us, image = first
        yield TimedImage(before_us, image, *wider), int(recent["t_us"][-1]), skipped
