"""From a recording or a device to images in order, and from images to estimates; of both cameras merged."""

from __future__ import annotations

import heapq
import math
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from itertools import repeat
from typing import NamedTuple

import numpy as np
import torch

from ..settings import OURS, Settings
from ..types import EVENT, AnyRecording, Estimate, InputError, Pose, concatenate_events
from . import agreement
from .crops import AT_ONCE, workers
from .estimator import Estimator
from .histograms import window_histograms, windows_at, windows_of
from .image_estimator import settings_for


class TimedImage(NamedTuple):
    """An image with its time; of events also the time and histogram of a wider window, or None."""

    t_us: int
    image: np.ndarray
    wider: tuple[int, np.ndarray] | None = None

    @property
    def times_us(self) -> set[int]:
        """The times that an estimate of it may have."""
        return {self.t_us} | ({self.wider[0]} if self.wider else set())


def timed_images(
    recording: AnyRecording,
    modality: str,
    settings: Settings | None = None,
    rate_hz: float | None = None,
) -> Iterator[TimedImage]:
    """The images of a recording in the order of time, read as the recording streams.

    For ``"rgb"`` they are the frames.  For ``"event"`` they are histograms of N events each or, at
    ``rate_hz``, of the last N events before each tick; a histogram's time is the middle of its events' span.
    A wider histogram comes with it once enough events have come, unless its time is not after that of the
    image before.  ``settings`` default to `settings_for` the recording's camera.
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
    """Every frame or, at ``rate_hz``, the first frame in each period; a millisecond early is in time."""
    period_us = 1e6 / rate_hz if rate_hz else 0
    due_us = -np.inf
    for t_us, frame in recording.timed_frames():
        if t_us >= due_us - 1000:
            due_us = max(due_us + period_us, t_us) if np.isfinite(due_us) else t_us + period_us
            yield TimedImage(int(t_us), frame)


def images(*args, **options) -> Iterator[tuple[int, np.ndarray]]:
    """``(t_us, image)`` of each of `timed_images`, which has the same arguments."""
    return ((timed.t_us, timed.image) for timed in timed_images(*args, **options))


class LiveImage(NamedTuple):
    """An image, the times of it and of its newest event (us), and how many were skipped before it; of
    events also the time and image of a wider window, or None."""

    t_us: int
    image: np.ndarray
    newest_us: int
    skipped: int
    wider: tuple[int, np.ndarray] | None = None


def newest_images(
    device,
    modality: str,
    count: int,
    wait_s: float = 0.001,
    seconds: float | None = None,
    take_events: Callable[[np.ndarray], None] | None = None,
) -> Iterator[LiveImage]:
    """The newest frame of a device, or the histogram of its newest ``count`` events once so many are new, as
    long as it runs, or for so many seconds; a wider one where its time is after the image before.

    Nothing queues: what could not be looked at in time is counted as skipped, so that a slow machine answers
    late for few images, not later and later for all.  ``take_events`` is called with all events (M,) that
    have come, before an image is made of them.
    """
    recent, fresh, before_us = np.zeros(0, EVENT), 0, None
    began = time.monotonic()
    while device.running() and (seconds is None or time.monotonic() - began < seconds):
        if not (pending := device.pending(modality)):
            time.sleep(wait_s)
            continue
        if modality == "rgb":
            t_us, frame = pending[-1]
            yield LiveImage(t_us, frame, t_us, len(pending) - 1)
            continue
        come = concatenate_events(pending)
        if take_events is not None and len(come):
            take_events(come)
        fresh += len(come)
        recent = concatenate_events([recent, come])[-math.ceil(OURS.second_look_factor) * count :]
        if fresh < count:
            time.sleep(wait_s)
            continue
        skipped, fresh = fresh // count - 1, 0
        first, *wider = window_histograms(recent, count, device.size_px, before_us)
        yield LiveImage(*first, int(recent["t_us"][-1]), skipped, *wider)
        before_us = first[0]


def estimate_image(estimator: Estimator, timed: TimedImage) -> tuple[np.ndarray, Estimate]:
    """``(image, estimate)`` of a `TimedImage`: by its wider image as well where the first shows no sure pose,
    and of the image whose pose it is."""
    estimate = estimator(timed.image, timed.t_us)
    if timed.wider and agreement.needs_more_events(estimate, estimator.settings):
        t_us, image = timed.wider
        estimate = estimator.together([estimate, estimator(image, t_us)])
        if estimate.t_us == t_us:
            return image, estimate
    return timed.image, estimate


def estimate_images(timed: Iterable[TimedImage], estimator: Estimator) -> Iterator[tuple]:
    """Yield ``(image, estimate)`` for each `TimedImage`, in their order, as `each_image` does."""
    return each_image(timed, partial(estimate_image, estimator))


def each_image(timed: Iterable[TimedImage], function: Callable[[TimedImage], object]) -> Iterator:
    """Yield a function's value of each `TimedImage`, in their order; two are worked on at a time.

    On two cores that is faster than two threads on one image, because the numpy half runs on one thread.  An
    `InputError` among the images is raised after the values of those before it.
    """
    waiting, end, timed = deque(), None, iter(timed)
    with workers(torch.get_num_threads()) as pool:
        while waiting or not end:
            try:
                while not end and len(waiting) <= AT_ONCE:
                    waiting.append(pool.submit(function, next(timed)))
            except (StopIteration, InputError) as reason:
                end = reason
            if waiting:
                yield waiting.popleft().result()
    if isinstance(end, InputError):
        raise end


def estimate(
    recording: AnyRecording, estimator: Estimator, rate_hz: float | None = None
) -> Iterator[Estimate]:
    """Estimates of a whole recording, in the order of time."""
    timed = timed_images(recording, estimator.modality, estimator.settings, rate_hz)
    return (estimate for _, estimate in estimate_images(timed, estimator))


def merge_by_time(estimates: Mapping[str, Iterable[Estimate]]) -> Iterator[tuple[str, Estimate]]:
    """``(modality, estimate)`` in the order of time, of modalities whose own estimates are in that order."""
    named = [zip(repeat(modality), own) for modality, own in estimates.items()]
    return heapq.merge(*named, key=lambda pair: pair[1].t_us)


def true_poses(recording: AnyRecording, estimates: list[Estimate]) -> tuple[list[Estimate], Pose]:
    """The estimates whose time the truth covers, and the true poses then."""
    span = recording.truth.t_us
    known = [e for e in estimates if span[0] <= e.t_us <= span[-1]]
    return known, recording.truth.at(np.array([e.t_us for e in known], np.int64))
