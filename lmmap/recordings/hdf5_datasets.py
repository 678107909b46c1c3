"""Datasets of an untrusted HDF5 file, opened only if the file itself holds all that they promise.

HDF5 makes up the values of chunks that were never written, follows links into other files, and inflates a
chunk to any size before it compares it with the one stated.
"""

from __future__ import annotations

import math
import os
import zlib
from collections.abc import Iterator

import h5py
import hdf5plugin as hdf5plugin  # gives h5py the filter that DSEC's own files use
import numpy as np

from .limits import MAX_CHUNK_BYTES

GZIP, SHUFFLE, FLETCHER32, LZF, BLOSC = 1, 2, 3, 32_000, hdf5plugin.BLOSC_ID
FILTERS = {GZIP, SHUFFLE, FLETCHER32, LZF, BLOSC}  # others crash on damaged chunks: SZ and Bitshuffle did
ECF = 0x8ECF  # of Prophesee's software
_checked: dict[tuple, None] = {}  # the datasets of files whose chunks have been checked
DEFLATE_RATIO = 1032  # the most that zlib inflates a byte to


def open_dataset(group: h5py.Group, name: str, *ndims: int, columns: str = "") -> h5py.Dataset:
    """Open a dataset of numbers that this file holds, with one of ``ndims`` dimensions.

    With ``columns``, one letter each, its elements must be records with numbers under these names.

    Raises
    ------
    ValueError
        For any other dataset; the message says what is wrong with it.
    KeyError
        If there is no dataset of this name.
    """
    dataset = group[name]
    if not isinstance(dataset, h5py.Dataset):
        raise ValueError(f"{name} is not a data set")
    if not _holds_numbers(dataset.dtype, columns):
        expected = f"records of {', '.join(columns)}" if columns else "numbers"
        raise ValueError(f"{name} does not hold {expected}")
    if dataset.ndim not in ndims:
        raise ValueError(f"{name} of shape {dataset.shape}")
    layout = dataset.id.get_create_plist()
    check_place(group, dataset, name)
    filters = [layout.get_filter(k)[0] for k in range(layout.get_nfilters())]
    if foreign := sorted(set(filters) - FILTERS):
        kind = "Prophesee's ECF; export the recording as RAW" if ECF in foreign else f"filter {foreign[0]}"
        raise ValueError(f"{name}: expected gzip or Blosc, but it is compressed by {kind}")
    if dataset.chunks is not None:
        facts = os.stat(dataset.file.filename)
        key = dataset.file.filename, facts.st_mtime_ns, facts.st_size, dataset.name
        if key not in _checked:  # a recording's datasets are opened once more for each pass over them
            _check_chunks(dataset, filters)
            _checked[key] = None
            while len(_checked) > 100:
                del _checked[next(iter(_checked))]
    elif layout.get_layout() == h5py.h5d.CONTIGUOUS:
        end = (dataset.id.get_offset() or 0) + dataset.nbytes
        if dataset.id.get_storage_size() != dataset.nbytes or end > os.path.getsize(dataset.file.filename):
            raise ValueError(f"{name} was never written")
    return dataset


def check_place(group: h5py.Group, dataset: h5py.Dataset, name: str) -> None:
    """Raise ValueError unless a data set lies in its group's file."""
    outside = dataset.is_virtual or dataset.id.get_create_plist().get_external_count()
    if outside or dataset.file.filename != group.file.filename:
        raise ValueError(f"{name} lies in another file")


def _holds_numbers(kind: np.dtype, columns: str) -> bool:
    if not columns:
        return kind.kind in "iufb"
    return {*columns} <= {*(kind.names or ())} and all(kind[name].kind in "iufb" for name in kind.names or ())


def blocks(least: int, *datasets: h5py.Dataset) -> Iterator[list[np.ndarray]]:
    """Yield datasets of one length in blocks of rows, as many at a time as `rows_at_once` allows."""
    step = rows_at_once(least, *datasets)
    for i in range(0, len(datasets[0]), step):
        yield [dataset[i : i + step] for dataset in datasets]


def rows_at_once(least: int, *datasets: h5py.Dataset) -> int:
    """How many rows of datasets to read at a time: enough that chunks of more than ``least`` rows are
    inflated only once, but no more than `MAX_CHUNK_BYTES`."""
    row_bytes = sum(d.dtype.itemsize * math.prod(d.shape[1:]) for d in datasets)
    wanted = max(least, *(d.chunks[0] for d in datasets if d.chunks), 1)
    return max(1, min(wanted, MAX_CHUNK_BYTES // max(row_bytes, 1)))


def _check_chunks(dataset: h5py.Dataset, filters: list[int]) -> None:
    """ValueError unless every chunk was written, and inflates to no more than its size."""
    nominal = math.prod(dataset.chunks) * dataset.dtype.itemsize
    if nominal > MAX_CHUNK_BYTES:
        raise ValueError(f"{dataset.name} in chunks of shape {dataset.chunks}")
    expected = math.prod(-(-n // size) for n, size in zip(dataset.shape, dataset.chunks, strict=True))
    count = dataset.id.get_num_chunks()
    if count != expected:
        raise ValueError(f"{dataset.name} holds {count} of {expected} chunks")
    if not {GZIP, BLOSC} & set(filters):
        return
    stored: list = []
    dataset.id.chunk_iter(stored.append)
    with open(dataset.file.filename, "rb") as file:
        for chunk in stored:
            if not _inflates_to(file.fileno(), chunk, filters, nominal):
                raise ValueError(f"{dataset.name} has a chunk that inflates beyond its {nominal} bytes")


def _inflates_to(file: int, chunk, filters: list[int], nominal: int) -> bool:
    """Whether a stored chunk inflates to at most ``nominal`` bytes, as far as that needs to be known."""
    if BLOSC in filters:  # its header states the size that the filter allocates
        head = os.pread(file, 8, chunk.byte_offset)
        return len(head) < 8 or int(np.frombuffer(head, "<u4")[1]) <= nominal
    if chunk.size * DEFLATE_RATIO <= MAX_CHUNK_BYTES:
        return True
    inflate = zlib.decompressobj()
    try:
        return len(inflate.decompress(os.pread(file, chunk.size, chunk.byte_offset), nominal + 1)) <= nominal
    except zlib.error:
        return chunk.filter_mask != 0
