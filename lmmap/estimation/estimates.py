"""From images in order to estimates, and both cameras' estimates merged."""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Future
from functools import partial
from itertools import repeat

import numpy as np
import torch

from ..pipeline.crops import AT_ONCE, workers
from ..pipeline.image_estimator import ImageEstimator
from ..types import AnyRecording, Estimate, InputError, checked
from .images import TimedImage, timed_images


def estimate_image(estimator: ImageEstimator, timed: TimedImage) -> tuple[np.ndarray, Estimate]:
    """``(image, estimate)`` of a `TimedImage`: by its wider image as well where the first shows no sure pose,
    and of the image whose pose it is."""
    t_us, image = timed.wider or (None, None)
    estimate = estimator(timed.image, timed.t_us, **({"wider": timed.wider} if timed.wider else {}))
    return timed.image if image is None or estimate.t_us != t_us else image, estimate


def estimate_images(timed: Iterable[TimedImage], estimator: ImageEstimator) -> Iterator[tuple]:
    """Yield ``(image, estimate)`` for each `TimedImage`, in their order, as `each_image` does."""
    return each_image(timed, partial(estimate_image, estimator))


def each_image(timed: Iterable[TimedImage], function: Callable[[TimedImage], object]) -> Iterator:
    """Yield a function's value of each `TimedImage`, in their order; two are worked on at a time.

    On two cores that is faster than two threads on one image, because the numpy half runs on one thread.  An
    `InputError` among the images is raised after the values of those before it.
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
    """Estimates of a whole recording, in the order of time.

    Examples
    --------
    >>> frames = np.zeros((2, 260, 346, 3), np.uint8)
    >>> camera = lmmap.Camera.davis346()
    >>> dark = lmmap.Recording("dark", camera, np.zeros(0, EVENT), frames, [0, 50_000])
    >>> [e.t_us for e in lmmap.estimate(dark, lmmap.Estimator(modality="rgb"))]
    [0, 50000]
    """
    timed = timed_images(recording, estimator.modality, estimator.settings, rate_hz)
    return (estimate for _, estimate in estimate_images(timed, estimator))


def merge_by_time(estimates: Mapping[str, Iterable[Estimate]]) -> Iterator[tuple[str, Estimate]]:
    """``(modality, estimate)`` in the order of time, of modalities whose own estimates are in that order."""
    named = [zip(repeat(modality), own) for modality, own in estimates.items()]
    return heapq.merge(*named, key=lambda pair: pair[1].t_us)
