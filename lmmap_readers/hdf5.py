"""HDF5 of other programs: the layouts of DSEC, M3ED, MVSEC and Prophesee."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path

import h5py
import numpy as np

from lmmap.recordings.hdf5 import columns, dsec, frames, hdf5_file, offset_of_us, opened, stated_size_px
from lmmap.recordings.hdf5_datasets import blocks, check_place, open_dataset
from lmmap.recordings.stream import CHUNK, Source
from lmmap.types import event_array

from . import prophesee
from .camera_fields import stated_size
from .time_units import microseconds
from .units import RUN, Guessed

# of one camera each: DSEC's and ours, M3ED's, MVSEC's
GROUPS = ("events", "prophesee/left", "prophesee/right", "davis/left", "davis/right")
CALIBRATION = ("resolution", "intrinsics", "distortion_coeffs", "camera_model", "distortion_model")  # M3ED


@hdf5_file
def read(path: Path, time_unit: str | None = None, stream: str | None = None) -> Source:
    """Read events and images, and the sensor's size if the file states it; raises `InputError`.

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
            in_us = partial(microseconds, unit=time_unit)
            t, offset_us = columns(file, group)[0], offset_of_us(file, in_us)
            cameras = _cameras(file, f"{group}/calib")
            size_px = stated_size_px(file) or next(map(stated_size, cameras.values()), None)
            events = partial(opened, path, partial(dsec, group=group, in_us=in_us))
            images = partial(frames, path, "", "frames", "frames_t_us", partial(microseconds, unit=None))
            span_us = None
            if len(t):
                ends = np.array([t[0], t[-1]])
                span_us = tuple(offset_us + int(end_us) for end_us in microseconds(ends, time_unit))
            guessed = None if time_unit else Guessed.of(t[:RUN], t[-RUN:])
            inside = partial(dict, cameras)
            return Source(path, size_px, events, images, span_us, cameras=inside, guessed=guessed)
        if prophesee.HDF5_EVENTS in file:
            events = partial(opened, path, partial(prophesee.hdf5_events, time_unit=time_unit))
            span_us = prophesee.hdf5_span_us(file, time_unit)
            return Source(path, prophesee.hdf5_size_px(file), events, span_us=span_us)
        raise ValueError("neither events/t nor davis/left nor CD/events in it")


def _chosen(path: Path, groups: list[str], wanted: str | None) -> str | None:
    """The group of the camera to read; a warning names the others."""
    if wanted is not None and wanted not in groups:
        raise ValueError(f"no camera {wanted!r:.30} in it (--stream); it has {', '.join(groups) or 'one'}")
    if groups[1:] and wanted is None:
        left = f"not {', '.join(groups[1:])}; choose with --stream"
        warnings.warn(f"{path}: taking {groups[0]}, {left}", stacklevel=7)
    return wanted or next(iter(groups), None)


def _read_mvsec(path: Path, file: h5py.File, group: str, time_unit: str | None) -> Source:
    name = f"{group}/image_raw"
    size_px = open_dataset(file, name, 3, 4).shape[2:0:-1] if name in file else None
    images = partial(
        frames, path, f"{group}/", "image_raw", "image_raw_ts", partial(microseconds, unit=time_unit)
    )
    return Source(
        path, size_px, partial(opened, path, partial(_mvsec, group=group, time_unit=time_unit)), images
    )


def _cameras(file: h5py.File, group: str) -> dict[str, dict]:
    """What a group says of its calibration, for `calibrations`, which refuses what is missing."""
    if group not in file:
        return {}
    values = dict.fromkeys(CALIBRATION[1:], "unreadable")
    for name in CALIBRATION:
        with suppress(KeyError, ValueError):
            place, numbers = f"{group}/{name}", name in CALIBRATION[:3]
            values[name] = open_dataset(file, place, 1)[:100].tolist() if numbers else _text(file, place)
    return {group: values}


def _mvsec(file: h5py.File, group: str, time_unit: str | None) -> Iterator[np.ndarray]:
    rows = open_dataset(file, f"{group}/events", 2)
    if rows.shape[1] != 4:
        raise ValueError(f"events of shape {rows.shape}, expected columns x, y, t, p")
    for (block,) in blocks(CHUNK, rows):
        x, y, t, p = block.T
        yield event_array(microseconds(t, time_unit or "s"), x, y, p)


def _text(group: h5py.Group, name: str) -> str:
    """The text of a data set that holds one, in this file; raises as `open_dataset`."""
    dataset = group[name]
    if not isinstance(dataset, h5py.Dataset) or not h5py.check_string_dtype(dataset.dtype) or dataset.shape:
        raise ValueError(f"{name} is not a text")
    check_place(group, dataset, name)
    return dataset.asstr()[()]
