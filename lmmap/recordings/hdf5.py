"""HDF5: the layouts of DSEC (ours adds frames and the sensor's size to it) and of MVSEC."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import h5py
import hdf5plugin as hdf5plugin  # makes h5py read the filter that DSEC's own files use
import numpy as np

from ..pipeline.histograms import from_columns
from ..types import Recording
from .stream import CHUNK, Source, input_errors


def read(path: Path) -> Source:
    """Size where the file says it (else None); raises `InputError`.

    DSEC: ``events/{t,x,y,p}`` in microseconds after ``t_offset``.  MVSEC: ``davis/left/events`` with rows
    x, y, seconds, polarity, and ``image_raw`` with ``image_raw_ts``.
    """
    with _file_errors(path), h5py.File(path, "r") as file:
        if "events/t" in file:
            t = _columns(file)[0]
            span_us = tuple(_offset_us(file) + int(t[k]) for k in (0, -1)) if len(t) else None
            size_px = tuple(int(n) for n in file.attrs["size_px"]) if "size_px" in file.attrs else None
            frames = partial(_frames, path, "", "frames", "frames_t_us")
            return Source(path, size_px, partial(_dsec, path), frames, span_us)
        if "davis/left" in file:
            group = file["davis/left"]
            size_px = group["image_raw"].shape[2:0:-1] if "image_raw" in group else None
            frames = partial(_frames, path, "davis/left/", "image_raw", "image_raw_ts")
            return Source(path, size_px, partial(_mvsec, path), frames)
        raise ValueError("neither events/t nor davis/left in it")


def _columns(file: h5py.File) -> list[h5py.Dataset]:
    columns = [file[f"events/{name}"] for name in "txyp"]
    if len({c.shape for c in columns}) != 1 or columns[0].ndim != 1:
        raise ValueError(f"columns of shapes {', '.join(str(c.shape) for c in columns)}")
    return columns


def _offset_us(file: h5py.File) -> int:
    return int(file["t_offset"][()]) if "t_offset" in file else 0


def _dsec(path: Path):
    with _file_errors(path), h5py.File(path, "r") as file:
        offset_us, columns = _offset_us(file), _columns(file)
        for i in range(0, len(columns[0]), CHUNK):
            yield from_columns(*(c[i : i + CHUNK] for c in columns), offset_us=offset_us)


def _mvsec(path: Path):
    with _file_errors(path), h5py.File(path, "r") as file:
        rows = file["davis/left/events"]
        for i in range(0, len(rows), CHUNK):
            x, y, t, p = rows[i : i + CHUNK].T
            yield from_columns(t, x, y, p, seconds=True)


def _frames(path: Path, group: str, images: str, times: str):
    with _file_errors(path), h5py.File(path, "r") as file:
        if group + images not in file:
            return
        pixels, t = file[group + images], file[group + times][:]
        if pixels.dtype != np.uint8 or pixels.ndim not in (3, 4) or pixels.shape[3:] not in ((), (3,)):
            raise ValueError(f"expected images of 8 bit, got {pixels.dtype} of shape {pixels.shape}")
        if t.shape != pixels.shape[:1]:
            raise ValueError(f"{len(pixels)} images but times of shape {t.shape}")
        t_us = (np.rint(t * 1e6) if t.dtype.kind == "f" else t).astype(np.int64).tolist()
        for i, frame_us in enumerate(t_us):
            image = pixels[i]
            yield frame_us, np.repeat(image[..., None], 3, -1) if image.ndim == 2 else image


def _file_errors(path: Path):
    remedy = "give a file as DSEC's or MVSEC's, or copy it again"
    return input_errors(path, "not a recording in HDF5", remedy, (KeyError, RuntimeError))


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
