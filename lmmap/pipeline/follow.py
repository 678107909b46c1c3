"""The ring about where it is expected: masks in crops, and its contour from the expected ellipse."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
import torch

from ..refinement import contour
from ..refinement.contour import Contour
from ..settings import OURS, Settings
from ..types import Camera, Ellipse
from .ellipse import arc_coverage
from .network import Box, crop_bounds

LEAST_CROP_PX = 80  # a side, at least: of smaller images oneDNN adds up in another order


class Expected(NamedTuple):
    """Where the ring is expected: its ellipse, undistorted, a box that holds all that is looked at of it, and
    one that holds the markers."""

    ellipse: Ellipse
    ring: Box
    markers: Box


def mask_within(network, image: np.ndarray, low_px, high_px) -> np.ndarray:
    """A network's mask (H, W) of an image: within a box what it is on the whole image, and zero elsewhere.

    In float32 on one thread the values are equal bit by bit.  On more threads oneDNN adds up the second
    transposed convolution in an order that depends on the image's size, and they differ by about 1e-8.
    """
    height, width = image.shape[:2]
    last = np.array([width, height]) - 1
    low, high = np.clip([np.floor(low_px), np.ceil(high_px)], 0, last).astype(int)
    start = np.clip((low + high - LEAST_CROP_PX) // 2, 0, np.maximum(last - LEAST_CROP_PX, 0))
    crop = crop_bounds(np.minimum(low, start), np.maximum(high, start + LEAST_CROP_PX), last + 1, network)
    box, mask = np.s_[low[1] : high[1] + 1, low[0] : high[0] + 1], np.zeros((height, width), np.float32)
    whole = np.zeros_like(mask)
    whole[crop] = network(image[crop])
    mask[box] = whole[box]
    return mask


def at_once(*functions: Callable[[], object]) -> list:
    """The values of two functions, which run at once on half of torch's threads each: of a small crop two
    threads make a mask little sooner than one."""
    if (each := torch.get_num_threads() // 2) == 0:
        return [function() for function in functions]
    tasks = [_workers(each, os.getpid()).submit(function) for function in functions]
    return [task.result() for task in tasks]


@cache
def _workers(threads: int, process: int) -> ThreadPoolExecutor:
    """Two threads, kept for the next image, each with so many of torch's; a forked process has its own."""
    return ThreadPoolExecutor(2, "lmmap", torch.set_num_threads, (threads,))


def follow(
    expected: Ellipse, mask: np.ndarray, half_width_px: float, camera: Camera, settings: Settings = OURS
) -> tuple[Contour, float] | None:
    """The contour that a mask has about the expected ellipse, and its arc coverage; None unless the mask
    alone, without the expectation, passes the gates that hold for any ring.

    Parameters
    ----------
    half_width_px : of the strip about the ellipse in which the mask's stroke is looked for
    """
    ring = contour.trace(expected, mask, half_width_px, camera, settings, rounds=(2,))
    if ring is None:
        return None
    major, minor = ring.ellipse.semi_axes_px
    if minor < settings.min_axis_ratio * major or major < settings.min_semi_major_px:
        return None
    coverage = arc_coverage(ring.ellipse, ring.points_px)
    ring = replace(ring, score=contour.score(ring.ellipse, mask, camera))
    if (
        coverage < settings.min_arc_coverage
        or ring.score < settings.min_arc_coverage * settings.mask_threshold
    ):
        return None
    return ring, coverage
