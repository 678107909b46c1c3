"""HDF5: the layouts of DSEC (ours adds frames and the sensor's size to it), M3ED and MVSEC."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path

import h5py
import numpy as np

from ..calibrations import stated_size
from ..types import event_array
from . import prophesee
from .depth import eight_bit
from .hdf5_datasets import blocks, open_dataset, open_text
from .limits import MAX_TIME_US, check_image
from .stream import CHUNK, Source, pieces, reader
from .units import RUN, Guessed, microseconds

# of one camera each: DSEC's and ours, M3ED's, MVSEC's
GROUPS = ("events", "prophesee/left", "prophesee/right", "davis/left", "davis/right")
CALIBRATION = ("resolution", "intrinsics", "distortion_coeffs", "camera_model", "distortion_model")  # M3ED


@reader(
    "not a recording in HDF5", "give one as DSEC's or MVSEC's, or copy it again", (RuntimeError, KeyError)
)
def read(path: Path, time_unit: str | None = None, stream: str | None = None) -> Source:
    """Size where the file says it (else None); raises `InputError`.

    DSEC: ``events/{t,x,y,p}`` in microseconds after ``t_offset``; M3ED: the same in ``prophesee/left``, with
    its calibration.  MVSEC: ``davis/left/events`` with rows
    x, y, seconds, polarity, and ``image_raw`` with ``image_raw_ts``.
    Prophesee: ``CD/events`` with fields x, y, p, t.
    """
    with h5py.File(path, "r") as file:
        groups = [g for g in GROUPS if f"{g}/t" in file or (g.startswith("davis") and g in file)]
        if group := _chosen(path, groups, stream):
            if f"{group}/t" not in file:
                return _read_mvsec(path, file, group, time_unit)
            t, offset_us = _columns(file, group)[0], _offset_us(file, time_unit)
            cameras = _cameras(file, f"{group}/calib")
            size_px = _stated_size_px(file) or next(map(stated_size, cameras.values()), None)
            events = partial(_events, path, partial(_dsec, group=group, time_unit=time_unit))
            frames = eight_bit(path, partial(_frames, path, "", "frames", "frames_t_us"))
            span_us = None
            if len(t):
                ends = np.array([t[0], t[-1]])
                span_us = tuple(offset_us + int(end_us) for end_us in microseconds(ends, time_unit))
            guessed = None if time_unit else Guessed.of(t[:RUN], t[-RUN:])
            inside = partial(dict, cameras)
            return Source(path, size_px, events, frames, span_us, cameras=inside, guessed=guessed)
        if prophesee.HDF5_EVENTS in file:
            events = partial(_events, path, partial(prophesee.hdf5_events, time_unit=time_unit))
            span_us = prophesee.hdf5_span_us(file, time_unit)
            return Source(path, prophesee.hdf5_size_px(file), events, span_us=span_us)
        raise ValueError("neither events/t nor davis/left nor CD/events in it")


def _chosen(path: Path, groups: list[str], wanted: str | None) -> str | None:
    """The group of the camera to read; a warning names the others."""
    if wanted is not None and wanted not in groups:
        raise ValueError(f"no camera {wanted:.30} in it; it has {', '.join(groups) or 'one'}")
    if groups[1:] and wanted is None:
        left = f"not {', '.join(groups[1:])}; choose with --stream"
        warnings.warn(f"{path}: taking {groups[0]}, {left}", stacklevel=7)
    return wanted or next(iter(groups), None)


def _read_mvsec(path: Path, file: h5py.File, group: str, time_unit: str | None) -> Source:
    name = f"{group}/image_raw"
    size_px = open_dataset(file, name, 3, 4).shape[2:0:-1] if name in file else None
    frames = eight_bit(path, partial(_frames, path, f"{group}/", "image_raw", "image_raw_ts", time_unit))
    return Source(
        path, size_px, partial(_events, path, partial(_mvsec, group=group, time_unit=time_unit)), frames
    )


def _stated_size_px(file: h5py.File) -> tuple[int, int] | None:
    if "size_px" not in file.attrs:
        return None
    size = file.attrs["size_px"]
    if np.shape(size) != (2,) or np.asarray(size).dtype.kind not in "iu":
        raise ValueError("size_px is not a width and a height")
    check_image(int(size[0]), int(size[1]))
    return int(size[0]), int(size[1])


def _cameras(file: h5py.File, group: str) -> dict[str, dict]:
    """What a group says of its calibration, for `lmmap.calibrations`, which refuses what is missing."""
    if group not in file:
        return {}
    values = dict.fromkeys(CALIBRATION[1:], "unreadable")
    for name in CALIBRATION:
        with suppress(KeyError, ValueError):
            place, numbers = f"{group}/{name}", name in CALIBRATION[:3]
            values[name] = open_dataset(file, place, 1)[:100].tolist() if numbers else open_text(file, place)
    return {group: values}


def _columns(file: h5py.File, group: str) -> list[h5py.Dataset]:
    columns = [open_dataset(file, f"{group}/{name}", 1) for name in "txyp"]
    if len({c.shape for c in columns}) != 1:
        raise ValueError(f"columns of shapes {', '.join(str(c.shape) for c in columns)}")
    return columns


def _offset_us(file: h5py.File, time_unit: str | None) -> int:
    if "t_offset" not in file:
        return 0
    return int(microseconds(np.atleast_1d(open_dataset(file, "t_offset", 0)[()]), time_unit)[0])


def _events(path: Path, layout: Callable[[h5py.File], Iterator[np.ndarray]]) -> Iterator[np.ndarray]:
    with h5py.File(path, "r") as file:
        for events in layout(file):
            yield from pieces(events, CHUNK)


def _dsec(file: h5py.File, group: str, time_unit: str | None) -> Iterator[np.ndarray]:
    offset_us = _offset_us(file, time_unit)
    for t, *columns in blocks(CHUNK, *_columns(file, group)):
        yield event_array(microseconds(t, time_unit), *columns, offset_us=offset_us)


def _mvsec(file: h5py.File, group: str, time_unit: str | None) -> Iterator[np.ndarray]:
    rows = open_dataset(file, f"{group}/events", 2)
    if rows.shape[1] != 4:
        raise ValueError(f"events of shape {rows.shape}, expected columns x, y, t, p")
    for (block,) in blocks(CHUNK, rows):
        x, y, t, p = block.T
        yield event_array(microseconds(t, time_unit or "s"), x, y, p)


def _frames(
    path: Path, group: str, images: str, times: str, time_unit: str | None = None
) -> Iterator[tuple[int, np.ndarray]]:
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
        times = (frame_us for (block,) in blocks(CHUNK, t) for frame_us in _times_us(block, time_unit))
        images = (image for (block,) in blocks(1, pixels) for image in block)
        for frame_us, image in zip(times, images, strict=True):
            yield frame_us, np.repeat(image[..., None], 3, -1) if image.ndim == 2 else image


def _times_us(t: np.ndarray, time_unit: str | None) -> list[int]:
    """Times in microseconds: floats are seconds unless a unit is given."""
    t_us = microseconds(t, time_unit)
    if not np.all(np.abs(t_us.astype(float)) <= MAX_TIME_US):  # NaN neither
        raise ValueError("a time of an image is beyond any clock's")
    return t_us.astype(np.int64).tolist()
