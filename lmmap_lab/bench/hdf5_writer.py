"""Writes HDF5: DSEC's layout, with frames and the sensor's size added to it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py
import numpy as np

from lmmap.types import Recording


@contextmanager
def new_file(path: Path) -> Iterator[h5py.File]:
    """A new HDF5 file, which is kept in memory and written when the block succeeds.

    HDF5 itself ends the process, with signal 11, where the disk is full.
    """
    with h5py.File(path.name, "w", driver="core", backing_store=False) as file:
        yield file
        file.flush()
        content = file.id.get_file_image()
    path.write_bytes(content)


def write(recording: Recording, path: Path) -> None:
    """Write DSEC's layout with frames added, compressed and with checksums; raises `OSError`."""
    r, packed = recording, dict(compression="gzip", compression_opts=1, shuffle=True, fletcher32=True)
    offset_us = int(r.events["t_us"][0]) if len(r.events) else 0
    with new_file(path) as file:
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
