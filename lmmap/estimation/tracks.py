"""A tracker's answers over a recording: one for each image and, from events, at ticks between images."""

from __future__ import annotations

import heapq
from collections.abc import Generator, Iterable, Iterator, Mapping

import numpy as np

from ..pipeline.estimator import Estimator
from ..tracking.discord import watched
from ..tracking.tracker import Tracker
from ..types import EVENT, AnyRecording, Estimate
from .estimates import in_place
from .images import TimedImage, timed_images


def track(
    recording: AnyRecording, estimators: Mapping[str, Estimator], rate_hz: float | None,
    between_hz: float | None, name: str,
) -> Generator[tuple[np.ndarray | None, Estimate]]:  # fmt: skip
    """Run `track_images` over a recording with all estimators, checked by `watched`, whose warning begins
    with ``name``, and by `in_place`."""
    shots = [timed_images(recording, m, e.settings, rate_hz) for m, e in estimators.items()]
    timed = heapq.merge(*shots, key=lambda shot: shot.t_us)
    tracker = Tracker(*estimators.values(), events=bool(between_hz))
    answers = track_images(timed, tracker, recording.chunks() if between_hz else (), between_hz)
    settings = next(iter(estimators.values())).settings
    return in_place(watched(answers, tracker.discord, name), settings)


def track_images(
    timed: Iterable[TimedImage], tracker: Tracker, chunks: Iterable[np.ndarray] = (),
    between_hz: float | None = None,
) -> Iterator[tuple[np.ndarray | None, Estimate]]:  # fmt: skip
    """Yield ``(image, answer)`` for each `TimedImage` in time order and, with ``between_hz``, also
    ``(None, answer)`` at ticks of that rate from the first image on, from the images and events up to then,
    while there is a track.

    Of the two histograms, that of N events and the wider one, the image is the one with the answer's time.
    An image that is not later than its camera's previous one is skipped.

    Parameters
    ----------
    chunks
        The camera's events, (M,) EVENT each, in time order, for a tracker with ``events``.
    """
    events, first_us, last_us = _Events(chunks), 0, None
    for shot in _in_order(timed):
        answers: list[tuple[np.ndarray | None, Estimate]] = []
        if last_us is None:
            first_us = last_us = shot.t_us
        for t_us in _ticks(first_us, last_us, shot.t_us, between_hz) if between_hz else ():
            events.tell(tracker, t_us)
            if (e := tracker.at(t_us)).T_cam_port is None:
                break
            answers.append((None, e))
        if between_hz:
            events.tell(tracker, shot.t_us)
        answers.append(_answer(shot, tracker))  # a wider image is older than the last ticks
        last_us = shot.t_us
        yield from sorted(answers, key=lambda answer: answer[1].t_us)


class _Events:
    """The events of a stream, told to a tracker as its time goes on."""

    def __init__(self, chunks: Iterable[np.ndarray]):
        self._chunks = iter(chunks)
        self._held: np.ndarray | None = np.zeros(0, EVENT)

    def tell(self, tracker: Tracker, until_us: int) -> None:
        """Those before a time."""
        while self._held is not None:
            stop = np.searchsorted(self._held["t_us"], until_us)
            tracker.add_events(self._held[:stop])
            if stop < len(self._held):
                self._held = self._held[stop:]
                return
            self._held = next(self._chunks, None)


def _ticks(first_us: int, after_us: int, before_us: int, rate_hz: float) -> Iterator[int]:
    """The ticks between two times."""
    tick = int((after_us - first_us) * rate_hz / 1e6)
    while (t_us := first_us + round(tick * 1e6 / rate_hz)) < before_us:
        if t_us > after_us:
            yield t_us
        tick += 1


def _in_order(timed: Iterable[TimedImage]) -> Iterator[TimedImage]:
    last_us: dict[int, int] = {}  # by the number of an image's axes: one camera each
    for shot in timed:
        if shot.t_us > last_us.get(shot.image.ndim, -np.inf):
            last_us[shot.image.ndim] = shot.t_us
            yield shot


def _answer(shot: TimedImage, tracker: Tracker) -> tuple[np.ndarray, Estimate]:
    e = tracker(shot.image, shot.t_us, shot.wider)
    return (shot.wider[1] if shot.wider and e.t_us == shot.wider[0] else shot.image), e
