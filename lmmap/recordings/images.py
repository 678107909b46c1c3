"""Images as recordings: one picture, a folder of them with or without times, and videos."""

from __future__ import annotations

import io
import os
import re
from contextlib import contextmanager, suppress
from dataclasses import replace
from decimal import Decimal
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from .. import files
from ..files import regular_file
from .depth import eight_bit
from .limits import MAX_IMAGE_BYTES, MAX_LIST_BYTES, check_image
from .stream import Source, reader
from .tables import read_text

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".jpe", ".bmp", ".dib", ".tif", ".tiff", ".webp", ".jp2", ".avif",
                  ".pbm", ".pgm", ".ppm", ".pnm", ".ras", ".sr")  # fmt: skip
JPEG_END = b"\xff\xd9"
TURNED = "turned_by_metadata_deg"  # what is known of a recording whose metadata turn its images
EXIF_ORIENTATION, EXIF_DEG = 0x0112, {3: 180, 4: 180, 5: 90, 6: 90, 7: 270, 8: 270}
TIME_LISTS = ("timestamps.txt", "images.txt")


@reader(
    "not a folder of images",
    "give images and a timestamps.txt with a time for each, or --fps, or name one recording",
    (cv2.error,),
)
def read_folder(path: Path) -> Source:
    """Images and ``timestamps.txt`` or ``images.txt``: a line each, ``t`` (names sorted) or ``t name``.

    Times as in `tables.read_text`; an ``events.txt`` beside them is read too, as in RPG's data sets.
    """
    source, event_file = _sequence(path, *_list_pictures(path)), path / "events.txt"
    return replace(source, events=lambda: read_text(event_file).events()) if event_file.exists() else source


picture = reader("cannot read this picture", "give PNG or JPEG files", (cv2.error,))


@picture
def read_picture(path: Path) -> Source:
    """One picture as a frame at time zero; raises `InputError`."""
    return _sequence(path, [path], [0])


@picture
def read_numbered(path: Path, fps: float) -> Source:
    """A folder's pictures in the order of their names, ``fps`` to the second; raises `InputError`."""
    if not 0 < fps < 1e6:
        raise ValueError(f"{fps:g} pictures per second")
    if not (names := pictures_in(path)):
        raise ValueError(f"no {', '.join(IMAGE_SUFFIXES)} in it")
    return _sequence(path, names, [round(k * 1e6 / fps) for k in range(len(names))])


def _sequence(path: Path, names: list[Path], t_us: list[int]) -> Source:
    """Images of files, of which the first is decoded at once for its size."""
    first = read_image(names[0])

    def frames():
        yield t_us[0], first
        yield from zip(t_us[1:], map(read_image, names[1:]), strict=True)

    span_us = min(t_us), max(t_us)
    details = partial(_picture_details, names[0])
    return Source(path, first.shape[1::-1], frames=eight_bit(path, frames), span_us=span_us, details=details)


def _picture_details(path: Path) -> dict:
    with suppress(Exception), Image.open(path) as picture:  # of a picture that was decoded before
        if deg := EXIF_DEG.get(picture.getexif().get(EXIF_ORIENTATION)):
            return {TURNED: deg}
    return {}


def pictures_in(folder: Path) -> list[Path]:
    """The image files of a folder, in the order of the numbers in their names."""
    return sorted((p for p in folder.iterdir() if p.suffix.lower() in IMAGE_SUFFIXES), key=_numbers)


def _numbers(path: Path) -> tuple[list, str]:
    """A name's key: its texts and numbers by turns."""
    parts = re.split(r"([0-9]+(?:\.[0-9]+)?)", path.stem)
    return [Decimal(part) if k % 2 else part for k, part in enumerate(parts)], path.name


def _list_pictures(path: Path) -> tuple[list[Path], list[int]]:
    """The folder's images and their times (us), as its list states them."""
    lists = [path / name for name in TIME_LISTS if (path / name).is_file()]
    if not lists:
        raise ValueError("no timestamps.txt or images.txt in it")
    lines = [line.split() for line in files.read_text(lists[0], MAX_LIST_BYTES).splitlines()]
    lines = [line for line in lines if line and not line[0].startswith("#")]
    if all(len(line) == 1 for line in lines):
        names = pictures_in(path)
    elif any(len(line) == 1 for line in lines):
        raise ValueError(f"{lists[0].name} has lines with and without a name")
    else:
        names = [path / line[1] for line in lines]
    if len(names) != len(lines) or not names:
        raise ValueError(f"{len(names)} images for {len(lines)} times")
    return names, [round(float(t[0]) * 1e6) if "." in t[0] else int(t[0]) for t in lines]


def read_image(path: Path) -> np.ndarray:
    """The image (H, W, 3) RGB of a file, u8 or u16; ValueError, with its name, where it holds none."""
    try:
        return decode(regular_file(path, MAX_IMAGE_BYTES).read_bytes())
    except ValueError as error:
        raise ValueError(f"{path.name}: {error}") from None


def decode(content: bytes) -> np.ndarray:
    """The image (H, W, 3) RGB of a file's bytes, u8 or u16; ValueError where they are none, or too many.

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
    rgb = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR_RGB | cv2.IMREAD_ANYDEPTH)
    if rgb is None:
        raise ValueError("not an image that can be decoded")
    return rgb


@reader("not a video", "convert it to MP4 or copy it again", (cv2.error,))
def read_video(path: Path) -> Source:
    """Frames of a video at the times that the file states, from its start."""
    _, first = next(_video_frames(path))
    frames, details = partial(_video_frames, path), partial(_video_details, path)
    return Source(path, first.shape[1::-1], frames=frames, details=details)


def _video_details(path: Path) -> dict:
    with _quiet():
        deg = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG).get(cv2.CAP_PROP_ORIENTATION_META)
    return {TURNED: int(deg)} if deg else {}


def _video_frames(path: Path):
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
