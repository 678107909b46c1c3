"""HDF5 as we write it: DSEC's layout, with frames and the sensor's size added."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import h5py
import numpy as np

from ..types import event_array
from .hdf5_datasets import blocks, open_dataset
from .limits import MAX_TIME_US, check_image
from .stream import CHUNK, Source, pieces, reader

InUs = Callable[[np.ndarray], np.ndarray]  # makes times microseconds; ours are
as_stored = np.asarray
hdf5_file = reader(
    "not a recording in HDF5", "give one as DSEC's or MVSEC's, or copy it again", (RuntimeError, KeyError)
)


@hdf5_file
def read(path: Path, time_unit: str | None = None, stream: str | None = None) -> Source | None:
    """Read events ``events/{t,x,y,p}`` in microseconds after ``t_offset``, and ``frames`` at ``frames_t_us``.

    Return None unless the file, like ours, states its ``size_px`` and has times in whole numbers, or if an
    option asks for another layout.  Raises `InputError`.
    """
    with h5py.File(path, "r") as file:
        if time_unit or stream or "size_px" not in file.attrs or "events/t" not in file:
            return None
        t = columns(file, "events")[0]
        if t.dtype.kind not in "iu":
            return None
        start_us = offset_of_us(file)
        events = partial(opened, path, partial(dsec, group="events"))
        images = partial(frames, path, "", "frames", "frames_t_us")
        span_us = (start_us + int(t[0]), start_us + int(t[-1])) if len(t) else None
        return Source(path, stated_size_px(file), events, images, span_us)


def stated_size_px(file: h5py.File) -> tuple[int, int] | None:
    """Width and height of the sensor, if the file states them; ValueError if these are not sizes."""
    if "size_px" not in file.attrs:
        return None
    size = file.attrs["size_px"]
    if np.shape(size) != (2,) or np.asarray(size).dtype.kind not in "iu":
        raise ValueError("size_px is not a width and a height")
    check_image(int(size[0]), int(size[1]))
    return int(size[0]), int(size[1])


def columns(file: h5py.File, group: str) -> list[h5py.Dataset]:
    """The data sets t, x, y and p of a group; ValueError unless they have one shape."""
    found = [open_dataset(file, f"{group}/{name}", 1) for name in "txyp"]
    if len({c.shape for c in found}) != 1:
        raise ValueError(f"columns of shapes {', '.join(str(c.shape) for c in found)}")
    return found


def offset_of_us(file: h5py.File, in_us: InUs = as_stored) -> int:
    """The time (us) from which the times of all groups count; ``in_us`` converts times to microseconds."""
    if "t_offset" not in file:
        return 0
    return int(in_us(np.atleast_1d(open_dataset(file, "t_offset", 0)[()]))[0])


def opened(path: Path, layout: Callable[[h5py.File], Iterator[np.ndarray]]) -> Iterator[np.ndarray]:
    """Yield arrays of events (M,) EVENT from a file, read by the function for its layout."""
    with h5py.File(path, "r") as file:
        for events in layout(file):
            yield from pieces(events, CHUNK)


def dsec(file: h5py.File, group: str, in_us: InUs = as_stored) -> Iterator[np.ndarray]:
    """Yield arrays of events (M,) EVENT from a group of columns."""
    offset_us = offset_of_us(file, in_us)
    for t, *others in blocks(CHUNK, *columns(file, group)):
        yield event_array(in_us(t), *others, offset_us=offset_us)


def frames(
    path: Path, group: str, images: str, times: str, in_us: InUs = as_stored
) -> Iterator[tuple[int, np.ndarray]]:
    """Yield ``(t_us, (H, W, 3) image)`` from data sets of a group, if it has them; raises ValueError."""
    with h5py.File(path, "r") as file:
        if group + images not in file:
            return
        pixels, t = open_dataset(file, group + images, 3, 4), open_dataset(file, group + times, 1)
        if pixels.dtype not in (np.uint8, np.uint16) or pixels.shape[3:] not in ((), (3,)):
            raise ValueError(f"expected images of 8 or 16 bit, got {pixels.dtype} of shape {pixels.shape}")
        if t.shape != pixels.shape[:1]:
            raise ValueError(f"{len(pixels)} images but times of shape {t.shape}")
        if not len(pixels):
            return
        check_image(pixels.shape[2], pixels.shape[1])
        times_us = (frame_us for (block,) in blocks(CHUNK, t) for frame_us in _times_us(in_us(block)))
        pictures = (image for (block,) in blocks(1, pixels) for image in block)
        for frame_us, image in zip(times_us, pictures, strict=True):
            yield frame_us, np.repeat(image[..., None], 3, -1) if image.ndim == 2 else image


def _times_us(t_us: np.ndarray) -> list[int]:
    if not np.all(np.abs(t_us.astype(float)) <= MAX_TIME_US):  # NaN neither
        raise ValueError("a time of an image is beyond any clock's")
    return t_us.astype(np.int64).tolist()
