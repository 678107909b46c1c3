"""Estimates of images in time order, and both cameras' estimates merged."""

from __future__ import annotations

import heapq
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import Future
from functools import partial
from itertools import repeat

import numpy as np
import torch

from ..pipeline.crops import AT_ONCE, workers
from ..pipeline.image_estimator import ImageEstimator
from ..recordings.journal import Journal
from ..recordings.pose_files import round_trip
from ..settings import Settings
from ..tracking.fusion import fuse
from ..types import AnyRecording, Estimate, InputError, checked
from .images import TimedImage, timed_images


def estimate_image(estimator: ImageEstimator, timed: TimedImage) -> tuple[np.ndarray, Estimate]:
    """Estimate a `TimedImage`, with its wider image as well if the first shows no sure pose; return
    ``(image, estimate)`` with the image that the pose is from."""
    t_us, image = timed.wider or (None, None)
    estimate = estimator(timed.image, timed.t_us, **({"wider": timed.wider} if timed.wider else {}))
    return timed.image if image is None or estimate.t_us != t_us else image, estimate


def estimate_images(timed: Iterable[TimedImage], estimator: ImageEstimator) -> Iterator[tuple]:
    """Yield ``(image, estimate)`` for each `TimedImage`, in order, as `each_image` does."""
    return each_image(timed, partial(estimate_image, estimator))


def each_image(timed: Iterable[TimedImage], function: Callable[[TimedImage], object]) -> Iterator:
    """Yield a function's value for each `TimedImage`, in order, working on two images at a time.

    On two cores this is faster than two threads on one image, because the numpy half runs on one thread.  If
    fetching an image raises an `InputError`, the values of the images before it are yielded first.
    """
    waiting: deque[Future] = deque()
    end, timed = None, iter(timed)
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


@checked
def estimate(
    recording: AnyRecording, estimator: ImageEstimator, rate_hz: float | None = None
) -> Iterator[Estimate]:
    """Yield estimates for a whole recording in time order.

    A warning at the end says so if, in most poses, the markers are not where the port's geometry puts them.

    Parameters
    ----------
    rate_hz
        Estimates per second; by default one for every frame, or every N events.

    Raises
    ------
    ValueError
        If an argument has another type.
    InputError
        At the first fault in the recording.

    Examples
    --------
    >>> frames = np.zeros((2, 260, 346, 3), np.uint8)
    >>> camera = lmmap.Camera.davis346()
    >>> dark = lmmap.Recording("dark", camera, np.zeros(0, EVENT), frames, [0, 50_000])
    >>> [e.t_us for e in lmmap.estimate(dark, lmmap.Estimator(modality="rgb"))]
    [0, 50000]
    """
    return (estimate for _, estimate in estimate_rest(recording, estimator, rate_hz, None))


def estimate_rest(
    recording: AnyRecording, estimator: ImageEstimator, rate_hz: float | None, journal: Journal | None
) -> Generator[tuple[np.ndarray, Estimate]]:
    """Yield ``(image, estimate)`` for the images that are not yet in the journal, checked by `in_place`."""
    timed = timed_images(recording, estimator.modality, estimator.settings, rate_hz)
    left = (shot for shot in timed if journal is None or not journal.has(*shot.times_us))
    return in_place(estimate_images(left, estimator), estimator.settings)


def fuse_rest(
    recording: AnyRecording, estimators: Mapping[str, ImageEstimator], rate_hz: float | None,
    journal: Journal, parts: Mapping[str, Journal], name: str,
) -> Generator[tuple[None, Estimate]]:  # fmt: skip
    """Yield ``(None, estimate)`` for the fused estimates that are not yet in the journal.

    Each camera's own estimates go to its journal in ``parts``; those already there are not computed again.
    """

    def own(modality: str) -> Iterator[Estimate]:
        yield from parts[modality].done.values()
        for _, e in estimate_rest(recording, estimators[modality], rate_hz, parts[modality]):
            parts[modality].add(e)
            yield round_trip(e)

    each = merge_by_time({m: own(m) for m in estimators})
    fused = fuse(each, estimators["rgb"].port.yaw_period_rad, rate_hz, name=name)
    return ((None, e) for e in fused if not journal.has(e.t_us))


def in_place(answers: Iterable[tuple], settings: Settings) -> Generator[tuple]:
    """Pass ``(image, estimate)`` on; warn at the end if, in most poses, the markers are not where the port's
    geometry puts them."""
    off_px = []
    try:
        for image, e in answers:
            if e.markers_off_px is not None:
                off_px.append(e.markers_off_px)
            yield image, e
    finally:
        if len(off_px) >= settings.port_off_poses and np.median(off_px) > settings.port_off_px:
            text = f"the markers lie {np.median(off_px):.1f} px from where the port has them"
            warnings.warn(f"{text}; measure the port with lmmap calibrate --port", stacklevel=2)


def merge_by_time(estimates: Mapping[str, Iterable[Estimate]]) -> Iterator[tuple[str, Estimate]]:
    """Merge the estimates of each modality, already in time order, into one sequence of ``(modality,
    estimate)`` in time order."""
    named = [zip(repeat(modality), own) for modality, own in estimates.items()]
    return heapq.merge(*named, key=lambda pair: pair[1].t_us)
