"""Images as recordings: a folder of them with their times, and videos."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from ..files import read_text, regular_file
from . import text
from .limits import MAX_IMAGE_BYTES, MAX_LIST_BYTES, check_image
from .stream import Source, input_errors, no_events

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
JPEG_END = b"\xff\xd9"
TIME_LISTS = ("timestamps.txt", "images.txt")


def read_folder(path: Path) -> Source:
    """Images and ``timestamps.txt`` or ``images.txt``: a line each, ``t`` (names sorted) or ``t name``.

    Times as in `text.read`; an ``events.txt`` beside them is read too, as in RPG's data sets.
    """
    with _folder_errors(path):
        names, t_us = _list_pictures(path)
        first = read_image(names[0])
    event_file = path / "events.txt"
    events = partial(text.events, event_file) if event_file.exists() else no_events
    frames = partial(_folder_frames, path, names, t_us, first)
    return Source(path, first.shape[1::-1], events, frames, (min(t_us), max(t_us)))


def _list_pictures(path: Path) -> tuple[list[Path], list[int]]:
    """The folder's images and their times (us), as its list states them."""
    lists = [path / name for name in TIME_LISTS if (path / name).is_file()]
    if not lists:
        raise ValueError("no timestamps.txt or images.txt in it")
    lines = [line.split() for line in read_text(lists[0], MAX_LIST_BYTES).splitlines()]
    lines = [line for line in lines if line and not line[0].startswith("#")]
    if all(len(line) == 1 for line in lines):
        names = sorted(p for p in path.iterdir() if p.suffix.lower() in IMAGE_SUFFIXES)
    elif any(len(line) == 1 for line in lines):
        raise ValueError(f"{lists[0].name} has lines with and without a name")
    else:
        names = [path / line[1] for line in lines]
    if len(names) != len(lines) or not names:
        raise ValueError(f"{len(names)} images for {len(lines)} times")
    return names, [round(float(t[0]) * 1e6) if "." in t[0] else int(t[0]) for t in lines]


def _folder_frames(path: Path, names: list[Path], t_us: list[int], first: np.ndarray):
    with _folder_errors(path):
        yield from zip(t_us, images_from(first, names), strict=True)


def images_from(first: np.ndarray, names: list[Path]) -> Iterator[np.ndarray]:
    """The images of files, of which the first has been decoded for its size."""
    yield first
    yield from map(read_image, names[1:])


def _folder_errors(path: Path):
    remedy = "give images and a timestamps.txt with a time for each, or --fps, or name one recording"
    return input_errors(path, "not a folder of images", remedy, (cv2.error,))


def read_image(path: Path) -> np.ndarray:
    """The image (H, W, 3) u8 RGB of a file; ValueError, with its name, where it holds none."""
    try:
        return decode(regular_file(path, MAX_IMAGE_BYTES).read_bytes())
    except ValueError as error:
        raise ValueError(f"{path.name}: {error}") from None


def decode(content: bytes) -> np.ndarray:
    """The image (H, W, 3) u8 RGB of a file's bytes; ValueError where they are none, or where it is too large.

    Its size is read before its pixels are: a megabyte can stand for gigapixels.
    """
    try:
        with Image.open(io.BytesIO(content)) as header:
            check_image(*header.size)
            is_jpeg = header.format == "JPEG"
            header.verify()  # of PNG, that every part is there
    except (OSError, SyntaxError, Image.DecompressionBombError) as error:
        reason = "too many pixels" if isinstance(error, Image.DecompressionBombError) else "not an image"
        raise ValueError(reason) from None
    if is_jpeg and JPEG_END not in content[-4096:]:
        raise ValueError("an image that ends early")
    rgb = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR_RGB)
    if rgb is None:
        raise ValueError("not an image that can be decoded")
    return rgb


def read_video(path: Path) -> Source:
    """Frames of a video at the times that the file states, from its start."""
    _, first = next(_video_frames(path))
    return Source(path, first.shape[1::-1], frames=partial(_video_frames, path))


def _video_frames(path: Path):
    with input_errors(path, "not a video", "convert it to MP4 or copy it again", (cv2.error,)):
        os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # our one line says what is wrong
        with _quiet():
            video = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
            size = (video.get(k) for k in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
            if video.isOpened():
                check_image(*map(int, size))
            more, bgr = video.read()
        if not more:
            raise ValueError("no frame can be decoded")
        while more:
            yield round(video.get(cv2.CAP_PROP_POS_MSEC) * 1000), cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB)
            with _quiet():
                more, bgr = video.read()
        with _quiet():
            video.release()


@contextmanager
def _quiet():
    """Keep what FFmpeg writes to the process's stderr from the terminal, where our own one line says more."""
    saved, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(null)
