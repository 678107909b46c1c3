"""Plain files: RPG's text of events, a folder of images with their times, a video, our npz."""

from __future__ import annotations

import os
import zipfile
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from ..pipeline.histograms import from_columns
from ..types import EVENT, Recording
from .stream import CHUNK, Source, naming, no_events

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")


def read_text(path: Path) -> Source:
    """Events of lines ``t x y p``: seconds where they have a decimal point, else microseconds."""
    next(_text(path), None)  # what is no text is said now
    return Source(path, events=partial(_text, path))


def _text(path: Path):
    remedy = "expected lines 't x y p' with t in seconds, or in whole microseconds"
    with naming(path, "not events as text", remedy), path.open("rb") as file:
        tables = pd.read_csv(file, sep=r"\s+", header=None, comment="#", index_col=False, chunksize=CHUNK,
                             names=["t", "x", "y", "p", "more"])  # fmt: skip
        kind = None
        for table in tables:
            if table["more"].notna().any() or any(table[name].dtype.kind not in "if" for name in "txyp"):
                raise ValueError("a line does not hold four numbers")
            if kind not in (None, kind := table["t"].dtype.kind):
                raise ValueError("times with and without a decimal point")
            yield from_columns(*(table[n].to_numpy() for n in "txyp"), seconds=kind == "f")


def read_folder(path: Path) -> Source:
    """Images and ``timestamps.txt`` or ``images.txt``: a line each, ``t`` (names sorted) or ``t name``.

    Times as in `read_text`; an ``events.txt`` beside them is read too, as in RPG's data sets.
    """
    with _naming_folder(path):
        lists = [path / name for name in ("timestamps.txt", "images.txt") if (path / name).is_file()]
        if not lists:
            raise ValueError("no timestamps.txt or images.txt in it")
        lines = [line.split() for line in lists[0].read_text().splitlines()]
        lines = [line for line in lines if line and not line[0].startswith("#")]
        if all(len(line) == 1 for line in lines):
            names = sorted(p for p in path.iterdir() if p.suffix.lower() in IMAGE_SUFFIXES)
        else:
            names = [path / line[1] for line in lines]
        if len(names) != len(lines) or not names:
            raise ValueError(f"{len(names)} images for {len(lines)} times")
        t_us = [round(float(t[0]) * 1e6) if "." in t[0] else int(t[0]) for t in lines]
        size_px = _image(names[0]).shape[1::-1]
    text = path / "events.txt"
    events = partial(_text, text) if text.exists() else no_events
    return Source(path, size_px, events, partial(_folder, path, names, t_us), (min(t_us), max(t_us)))


def _folder(path: Path, names: list[Path], t_us: list[int]):
    with _naming_folder(path):
        for name, at_us in zip(names, t_us, strict=True):
            yield at_us, _image(name)


def _naming_folder(path: Path):
    remedy = "give images and a timestamps.txt with a time for each, or name one recording"
    return naming(path, "not a folder of images", remedy)


def _image(path: Path) -> np.ndarray:
    bgr = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_COLOR)
    if bgr is None:
        raise ValueError(f"{path.name} is not an image")
    return cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB)


def read_video(path: Path) -> Source:
    """Frames of a video at the times that the file states, from its start."""
    first = next(_video(path))
    return Source(path, first[1].shape[1::-1], frames=partial(_video, path))


def _video(path: Path):
    with naming(path, "not a video", "convert it to MP4 or copy it again"):
        os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # we say ourselves what is wrong, in one line
        video = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
        more, bgr = video.read()
        if not more:
            raise ValueError("no frame can be decoded")
        while more:
            yield round(video.get(cv2.CAP_PROP_POS_MSEC) * 1000), cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB)
            more, bgr = video.read()
        video.release()


def read_npz(path: Path) -> Source:
    """Our arrays ``events``, ``frames``, ``frames_t_us`` and ``size_px``; nothing in them is executed."""
    with _naming_npz(path), zipfile.ZipFile(path) as file:
        width, height = (int(n) for n in _array(file, "size_px"))
        if missing := {"events.npy", "frames.npy", "frames_t_us.npy"} - set(file.namelist()):
            raise ValueError(f"no {', '.join(sorted(missing))} in it")
    return Source(path, (width, height), partial(_npz_events, path), partial(_npz_frames, path))


def _npz_events(path: Path):
    with _naming_npz(path), zipfile.ZipFile(path) as file, file.open("events.npy") as member:
        (count,) = _head(member, EVENT, 1)
        for start in range(0, count, CHUNK):
            yield np.frombuffer(_exactly(member, min(CHUNK, count - start) * EVENT.itemsize), EVENT)
        _exactly(member, 0)


def _npz_frames(path: Path):
    with _naming_npz(path), zipfile.ZipFile(path) as file, file.open("frames.npy") as member:
        count, *shape = _head(member, np.dtype(np.uint8), 4)
        t_us = _array(file, "frames_t_us")
        if t_us.dtype != np.int64 or t_us.shape != (count,):
            raise ValueError(f"{count} frames, but times of type {t_us.dtype} and shape {t_us.shape}")
        for at_us in t_us.tolist():
            frame = _exactly(member, int(np.prod(shape)))
            yield at_us, np.frombuffer(frame, np.uint8).reshape(shape)
        _exactly(member, 0)


def _array(file: zipfile.ZipFile, name: str) -> np.ndarray:
    with file.open(f"{name}.npy") as member:
        return np.lib.format.read_array(member, allow_pickle=False)


def _head(member, dtype: np.dtype, ndim: int) -> tuple[int, ...]:
    """Shape of an array of the type and dimensions expected; its data come next."""
    version = np.lib.format.read_magic(member)
    read = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    shape, fortran, found = read[version](member)
    if found != dtype or fortran or len(shape) != ndim:
        raise ValueError(f"an array of type {found} and shape {shape}")
    return shape


def _exactly(member, size: int) -> bytes:
    """The next bytes; at the end (``size`` 0) the archive's checksum is compared by itself."""
    data = member.read(size) if size else member.read(1)
    if len(data) != size:
        raise ValueError("an array of another length than it states")
    return data


def _naming_npz(path: Path):
    return naming(path, "not a recording of ours", "write it with lmmap, or copy it again")


def write_npz(recording: Recording, path: Path) -> None:
    """Write compressed arrays; raises `OSError`.  Equal recordings make equal bytes."""
    r, events = recording, np.zeros(len(recording.events), EVENT)
    for name in EVENT.names:  # without what memory held between the fields
        events[name] = r.events[name]
    arrays = {"events": events, "frames": r.frames, "frames_t_us": r.frames_t_us, "size_px": r.camera.size_px}
    # numpy's own asks zlib for level 6: five times the time for five percent
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
        for name, array in arrays.items():
            with file.open(f"{name}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array(entry, np.asanyarray(array), allow_pickle=False)
