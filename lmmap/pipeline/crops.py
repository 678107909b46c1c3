"""Masks of parts of an image: the crop that a network needs, and two masks computed at once."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import NamedTuple

import numpy as np
import torch

from .network import MaskNetwork

LEAST_CROP_PX = 80  # a side, at least: of smaller images oneDNN adds up in another order
AT_ONCE = 2  # threads that work on masks or images in parallel


class Box(NamedTuple):
    """A part of an image: its lowest and its highest (u, v)."""

    low_px: np.ndarray
    high_px: np.ndarray

    def holds(self, other: Box) -> bool:
        """Whether another box lies entirely inside this one."""
        return bool(np.all(other.low_px >= self.low_px) and np.all(other.high_px <= self.high_px))

    def around(self, other: Box) -> Box:
        """The smallest box that holds this one and another."""
        return Box(np.minimum(self.low_px, other.low_px), np.maximum(self.high_px, other.high_px))


def crop_bounds(low_px, high_px, size_px, network=MaskNetwork) -> tuple[slice, slice]:
    """Rows and columns of a crop on which a network gives, within a box, the same mask as on the whole image.

    The crop is aligned to the network's ``stride_px`` and holds the inputs (``inputs_of``) of every output in
    the box.  For a callable without these attributes, the crop is the whole image.

    Parameters
    ----------
    low_px, high_px : (2,)
        Lowest and highest (u, v) of the box.
    size_px : (width, height)
        Size of the image.
    """
    size = np.asarray(size_px)
    if not hasattr(network, "inputs_of"):
        return slice(0, int(size[1])), slice(0, int(size[0]))
    stride = network.stride_px
    lowest, highest = network.inputs_of(0, stride - 1)  # of the outputs of one stride
    before_px, after_px = -(lowest // stride) * stride, (highest // stride + 1) * stride
    first = np.clip(np.floor(low_px), 0, size - 1) // stride * stride
    last = np.clip(np.ceil(high_px), 0, size - 1) // stride * stride
    start = np.maximum(first - before_px, 0).astype(int)
    stop = np.minimum(last + after_px, size).astype(int)
    return slice(start[1], stop[1]), slice(start[0], stop[0])


def mask_about(network, image: np.ndarray, low_px, high_px) -> np.ndarray:
    """A network's mask (H, W) of an image, or masks (M, H, W): correct within a box, zero outside the crop
    computed for it."""
    crop = crop_bounds(low_px, high_px, image.shape[1::-1], network)
    part = network(image[crop])
    mask = np.zeros((*part.shape[:-2], *image.shape[:2]), np.float32)
    mask[(..., *crop)] = part
    return mask


def mask_within(network, image: np.ndarray, low_px, high_px) -> np.ndarray:
    """As `mask_about`: within a box the same as on the whole image, and zero elsewhere.

    In float32 on one thread the values are equal bit by bit.  On more threads oneDNN adds up the second
    transposed convolution in an order that depends on the image's size, and they differ by about 1e-8.
    """
    last = np.array(image.shape[1::-1]) - 1
    low, high = np.clip([np.floor(low_px), np.ceil(high_px)], 0, last).astype(int)
    start = np.clip((low + high - LEAST_CROP_PX) // 2, 0, np.maximum(last - LEAST_CROP_PX, 0))
    whole = mask_about(network, image, np.minimum(low, start), np.maximum(high, start + LEAST_CROP_PX))
    box, mask = np.s_[..., low[1] : high[1] + 1, low[0] : high[0] + 1], np.zeros_like(whole)
    mask[box] = whole[box]
    return mask


def at_once(*functions: Callable[[], object]) -> list:
    """The values of two functions, run at once on half of torch's threads each, because two threads compute
    the mask of a small crop hardly faster than one."""
    if torch.get_num_threads() < AT_ONCE:
        return [function() for function in functions]
    tasks = [_kept_workers(torch.get_num_threads(), os.getpid()).submit(function) for function in functions]
    return [task.result() for task in tasks]


def workers(threads: int) -> ThreadPoolExecutor:
    """`AT_ONCE` threads that share this many of torch's."""
    return ThreadPoolExecutor(AT_ONCE, "lmmap", _share, (threads,))


def _share(threads: int) -> None:
    """Give this thread its part of torch's threads.  torch would also give it to each thread that the caller
    starts from now on, unless another one asks for the whole again."""
    torch.get_num_threads()  # else torch's first loop in this thread takes the number of the last who asked
    torch.set_num_threads(max(threads // AT_ONCE, 1))
    other = threading.Thread(target=torch.set_num_threads, args=(threads,))
    other.start()
    other.join()


@cache
def _kept_workers(threads: int, process: int) -> ThreadPoolExecutor:
    """`workers` that are kept for the next image; a forked process has its own."""
    return workers(threads)
