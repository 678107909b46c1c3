"""HDF5: the layouts of DSEC (ours adds frames and the sensor's size to it) and of MVSEC."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import h5py
import numpy as np

from .core import InputError, Recording
from .events import from_columns

with suppress(ImportError):  # DSEC's own files are compressed with a filter that h5py lacks
    import hdf5plugin  # noqa: F401


def read(path: Path):
    """Events, frames, their times and the size_px (None where the file does not say); raises `InputError`.

    DSEC: ``events/{t,x,y,p}`` in microseconds after ``t_offset``.  MVSEC: ``davis/left/events`` with rows
    x, y, seconds, polarity, and ``image_raw`` with ``image_raw_ts``.
    """
    try:
        with h5py.File(path, "r") as file:
            if "events/t" in file:
                return _dsec(file)
            if "davis/left" in file:
                return _mvsec(file["davis/left"])
            raise ValueError("neither events/t nor davis/left in it")
    except Exception as error:  # h5py raises half a dozen types on damaged bytes
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        remedy = "install hdf5plugin" if "filter" in reason else "give a DSEC or MVSEC file, or copy it again"
        raise InputError(f"{path}: not a recording in HDF5 ({reason}); {remedy}") from None


def _dsec(file: h5py.File):
    offset_us = int(file["t_offset"][()]) if "t_offset" in file else 0
    columns = (file["events"][name][:] for name in "txyp")
    events = from_columns(*columns, offset_us=offset_us)
    if "frames" not in file:
        return events, None, np.zeros(0, np.int64), None
    size_px = tuple(int(n) for n in file.attrs["size_px"])
    return events, _rgb(file["frames"]), file["frames_t_us"][:].astype(np.int64), size_px


def _mvsec(group: h5py.Group):
    x, y, t, p = group["events"][:].T
    events = from_columns(t, x, y, p, seconds=True)
    if "image_raw" not in group:
        return events, None, np.zeros(0, np.int64), None
    frames = _rgb(group["image_raw"])
    t_us = np.rint(group["image_raw_ts"][:] * 1e6).astype(np.int64)
    return events, frames, t_us, (frames.shape[2], frames.shape[1])


def _rgb(images: h5py.Dataset) -> np.ndarray:
    if images.dtype != np.uint8 or images.ndim not in (3, 4):
        raise ValueError(f"expected images of 8 bit, got {images.dtype} of shape {images.shape}")
    pixels = images[:]
    return np.repeat(pixels[..., None], 3, -1) if pixels.ndim == 3 else pixels


def write(recording: Recording, path: Path) -> None:
    """Write DSEC's layout with frames added, compressed and with checksums; raises `OSError`."""
    r, packed = recording, dict(compression="gzip", compression_opts=1, shuffle=True, fletcher32=True)
    offset_us = int(r.events["t_us"][0]) if len(r.events) else 0
    with h5py.File(path, "w") as file:
        file.attrs["size_px"] = r.camera.size_px
        file["t_offset"] = offset_us
        columns = {"t": r.events["t_us"] - offset_us, "x": r.events["x"], "y": r.events["y"]}
        for name, values in (columns | {"p": r.events["p"].astype(np.uint8)}).items():
            file.create_dataset(f"events/{name}", data=values, chunks=True, maxshape=(None,), **packed)
        shape = (None, *r.frames.shape[1:])
        file.create_dataset(
            "frames", data=r.frames, chunks=(1, *r.frames.shape[1:]), maxshape=shape, **packed
        )
        file["frames_t_us"] = r.frames_t_us
