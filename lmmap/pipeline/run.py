"""From a recording to poses: its images in order, what is looked at twice, and both cameras' answers."""

from __future__ import annotations

import heapq
import math
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from itertools import repeat
from typing import NamedTuple

import numpy as np
import torch

from ..settings import Settings
from ..types import AnyRecording, Estimate, InputError, Pose
from .estimator import Estimator, fitting
from .histograms import looks, windows_at, windows_of

AT_ONCE = 2  # images


class Shot(NamedTuple):
    """An image and its time; of events also the time and image of a wider window, or None."""

    t_us: int
    image: np.ndarray
    wider: tuple[int, np.ndarray] | None = None

    @property
    def times_us(self) -> set[int]:
        """The times that an estimate of it may have."""
        return {self.t_us} | ({self.wider[0]} if self.wider else set())


def shots(recording: AnyRecording, modality: str, settings: Settings | None = None,
          rate_hz: float | None = None) -> Iterator[Shot]:  # fmt: skip
    """Every frame, or one histogram for each N events (or, at ``rate_hz``, the last N events before each
    tick); a histogram's time is the middle of its events' span.

    A wider histogram is there once so many events have come, unless its time is not after the shot before.
    ``settings`` default to `fitting` the recording's camera.  Reads a stream as it goes.
    """
    if modality == "rgb":
        period_us = 1e6 / rate_hz if rate_hz else 0
        due = -np.inf
        for t_us, frame in recording.timed_frames():
            if t_us >= due - 1000:
                due = max(due + period_us, t_us) if np.isfinite(due) else t_us + period_us
                yield Shot(int(t_us), frame)
        return
    settings = settings or fitting(recording.camera)
    count = settings.events_per_window
    chunks, before_us = recording.chunks(), None
    most = math.ceil(settings.second_look_factor)
    windows = windows_at(chunks, rate_hz, count, most) if rate_hz else windows_of(chunks, count, most)
    for window in windows:
        first, *wider = looks(window, count, recording.camera.size_px, before_us, settings.second_look_factor)
        yield Shot(*first, *wider)
        before_us = first[0]


def images(*args, **options) -> Iterator[tuple[int, np.ndarray]]:
    """``(t_us, image)`` of each of `shots`, which has the same arguments."""
    return ((shot.t_us, shot.image) for shot in shots(*args, **options))


def looked(estimator: Estimator, shot: Shot) -> tuple[np.ndarray, Estimate]:
    """``(image, estimate)`` of a shot: where its image shows no port and the wider one does, of that."""
    found = shot.image, estimator(shot.image, shot.t_us)
    if shot.wider and found[1].T_cam_port is None:
        again = estimator(shot.wider[1], shot.wider[0])
        if again.T_cam_port is not None:
            return shot.wider[1], again
    return found


def answered(shots: Iterable[Shot], estimator: Estimator) -> Iterator[tuple]:
    """Yield ``(image, estimate)`` for each shot, in their order, two at a time.

    On two cores that is faster than two threads on one image: the numpy half has only one.  An error among
    the images comes after the estimates of those before it.
    """
    waiting, error, shots = deque(), None, iter(shots)
    threads = max(torch.get_num_threads() // AT_ONCE, 1)
    with ThreadPoolExecutor(AT_ONCE, initializer=torch.set_num_threads, initargs=(threads,)) as pool:
        while waiting or not error:
            try:
                while not error and len(waiting) <= AT_ONCE:
                    waiting.append(pool.submit(looked, estimator, next(shots)))
            except (StopIteration, InputError) as end:
                error = end
            if waiting:
                yield waiting.popleft().result()
    if isinstance(error, InputError):
        raise error


def estimate(
    recording: AnyRecording, estimator: Estimator, rate_hz: float | None = None
) -> Iterator[Estimate]:
    """Estimates of a whole recording, in the order of time."""
    of_it = shots(recording, estimator.modality, estimator.settings, rate_hz)
    return (one for _, one in answered(of_it, estimator))


def in_time(estimates: Mapping[str, Iterable[Estimate]]) -> Iterator[tuple[str, Estimate]]:
    """``(modality, estimate)`` in the order of time, of modalities whose own estimates are in that order."""
    named = [zip(repeat(modality), some) for modality, some in estimates.items()]
    return heapq.merge(*named, key=lambda one: one[1].t_us)


def true_poses(recording: AnyRecording, estimates: list[Estimate]) -> tuple[list[Estimate], Pose]:
    """The estimates whose time the truth covers, and the true poses then."""
    span = recording.truth.t_us
    known = [e for e in estimates if span[0] <= e.t_us <= span[-1]]
    return known, recording.truth.at(np.array([e.t_us for e in known], np.int64))
