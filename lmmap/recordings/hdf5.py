"""HDF5: the layouts of DSEC (ours adds frames and the sensor's size to it) and of MVSEC."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import h5py
import numpy as np

from ..types import event_array
from . import prophesee
from .hdf5_datasets import blocks, open_dataset
from .limits import MAX_TIME_US, check_image
from .stream import CHUNK, Source, pieces, reader


@reader(
    "not a recording in HDF5", "give one as DSEC's or MVSEC's, or copy it again", (RuntimeError, KeyError)
)
def read(path: Path) -> Source:
    """Size where the file says it (else None); raises `InputError`.

    DSEC: ``events/{t,x,y,p}`` in microseconds after ``t_offset``.  MVSEC: ``davis/left/events`` with rows
    x, y, seconds, polarity, and ``image_raw`` with ``image_raw_ts``.
    Prophesee: ``CD/events`` with fields x, y, p, t.
    """
    with h5py.File(path, "r") as file:
        if "events/t" in file:
            t = _columns(file)[0]
            span_us = tuple(_offset_us(file) + int(t[k]) for k in (0, -1)) if len(t) else None
            size_px = _stated_size_px(file)
            frames = partial(_frames, path, "", "frames", "frames_t_us")
            return Source(path, size_px, partial(_events, path, _dsec), frames, span_us)
        if "davis/left" in file:
            name = "davis/left/image_raw"
            size_px = open_dataset(file, name, 3, 4).shape[2:0:-1] if name in file else None
            frames = partial(_frames, path, "davis/left/", "image_raw", "image_raw_ts")
            return Source(path, size_px, partial(_events, path, _mvsec), frames)
        if prophesee.HDF5_EVENTS in file:
            events = partial(_events, path, prophesee.hdf5_events)
            return Source(path, prophesee.hdf5_size_px(file), events, span_us=prophesee.hdf5_span_us(file))
        raise ValueError("neither events/t nor davis/left nor CD/events in it")


def _stated_size_px(file: h5py.File) -> tuple[int, int] | None:
    if "size_px" not in file.attrs:
        return None
    size = file.attrs["size_px"]
    if np.shape(size) != (2,) or np.asarray(size).dtype.kind not in "iu":
        raise ValueError("size_px is not a width and a height")
    check_image(int(size[0]), int(size[1]))
    return int(size[0]), int(size[1])


def _columns(file: h5py.File) -> list[h5py.Dataset]:
    columns = [open_dataset(file, f"events/{name}", 1) for name in "txyp"]
    if len({c.shape for c in columns}) != 1:
        raise ValueError(f"columns of shapes {', '.join(str(c.shape) for c in columns)}")
    return columns


def _offset_us(file: h5py.File) -> int:
    return int(open_dataset(file, "t_offset", 0)[()]) if "t_offset" in file else 0


def _events(path: Path, layout: Callable[[h5py.File], Iterator[np.ndarray]]) -> Iterator[np.ndarray]:
    with h5py.File(path, "r") as file:
        for events in layout(file):
            yield from pieces(events, CHUNK)


def _dsec(file: h5py.File) -> Iterator[np.ndarray]:
    offset_us = _offset_us(file)
    for columns in blocks(CHUNK, *_columns(file)):
        yield event_array(*columns, offset_us=offset_us)


def _mvsec(file: h5py.File) -> Iterator[np.ndarray]:
    rows = open_dataset(file, "davis/left/events", 2)
    if rows.shape[1] != 4:
        raise ValueError(f"events of shape {rows.shape}, expected columns x, y, t, p")
    for (block,) in blocks(CHUNK, rows):
        x, y, t, p = block.T
        yield event_array(t, x, y, p, seconds=True)


def _frames(path: Path, group: str, images: str, times: str) -> Iterator[tuple[int, np.ndarray]]:
    with h5py.File(path, "r") as file:
        if group + images not in file:
            return
        pixels, t = open_dataset(file, group + images, 3, 4), open_dataset(file, group + times, 1)
        if pixels.dtype != np.uint8 or pixels.shape[3:] not in ((), (3,)):
            raise ValueError(f"expected images of 8 bit, got {pixels.dtype} of shape {pixels.shape}")
        if t.shape != pixels.shape[:1]:
            raise ValueError(f"{len(pixels)} images but times of shape {t.shape}")
        if not len(pixels):
            return
        check_image(pixels.shape[2], pixels.shape[1])
        times = (frame_us for (block,) in blocks(CHUNK, t) for frame_us in _times_us(block))
        images = (image for (block,) in blocks(1, pixels) for image in block)
        for frame_us, image in zip(times, images, strict=True):
            yield frame_us, np.repeat(image[..., None], 3, -1) if image.ndim == 2 else image


def _times_us(t: np.ndarray) -> list[int]:
    """Times in microseconds: floats are seconds."""
    if t.dtype.kind != "f":
        return t.tolist()
    if not np.all(np.abs(t) <= MAX_TIME_US / 1e6):  # NaN neither
        raise ValueError("a time of an image is beyond any clock's")
    return np.rint(t * 1e6).astype(np.int64).tolist()
