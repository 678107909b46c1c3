"""Images as recordings: a picture, a folder of pictures at a fixed rate, or a video."""

from __future__ import annotations

import io
import re
import warnings
from collections import Counter
from contextlib import suppress
from decimal import Decimal
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from ..files import regular_file
from ..types import InputError
from .limits import MAX_IMAGE_BYTES, check_image
from .stream import Source, reader

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".jpe", ".bmp", ".dib", ".tif", ".tiff", ".webp", ".jp2", ".avif",
                  ".pbm", ".pgm", ".ppm", ".pnm", ".ras", ".sr")  # fmt: skip
JPEG_END = b"\xff\xd9"
TURNED = "turned_by_metadata_deg"  # what is known of a recording whose metadata turn its images
EXIF_ORIENTATION, EXIF_DEG = 0x0112, {3: 180, 4: 180, 5: 90, 6: 90, 7: 270, 8: 270}
TIME_LISTS = ("timestamps.txt", "images.txt")


picture = reader("cannot read this picture", "give PNG or JPEG files", (cv2.error,))


@picture
def read_picture(path: Path) -> Source:
    """Read one picture as a frame at time zero; raises `InputError`."""
    return sequence(path, [path], [0])


@picture
def read_numbered(path: Path, fps: float | None = None, time_unit: str | None = None) -> Source | None:
    """Read a folder's pictures, ``fps`` per second, in the order of the numbers in their names; raises
    `InputError`.  Return None without a rate: their times are then in a list, which another reader reads."""
    if fps is None:
        return None
    if not 0 < fps < 1e6:
        raise InputError(f"{path}: --fps {fps:g}: give the pictures per second, over 0 and below 1e6")
    if not (names := pictures_in(path)):
        raise ValueError(f"no {', '.join(IMAGE_SUFFIXES)} in it")
    if found := next((name for name in TIME_LISTS if (path / name).is_file()), None):
        warnings.warn(f"{path}: the times in its {found} are not used, since a rate is given", stacklevel=5)
    return sequence(path, names, [round(k * 1e6 / fps) for k in _places(path, names)])


def sequence(path: Path, names: list[Path], t_us: list[int]) -> Source:
    """A source of image files at times (us); the first is decoded at once for its size."""
    first = read_image(names[0])

    def frames():
        yield t_us[0], first
        yield from zip(t_us[1:], map(read_image, names[1:]), strict=True)

    span_us = min(t_us), max(t_us)
    details = partial(_picture_details, names[0])
    return Source(path, first.shape[1::-1], frames=frames, span_us=span_us, details=details)


def _picture_details(path: Path) -> dict:
    with suppress(Exception), Image.open(path) as picture:  # of a picture that was decoded before
        if deg := EXIF_DEG.get(picture.getexif().get(EXIF_ORIENTATION, 0)):
            return {TURNED: deg}
    return {}


def pictures_in(folder: Path) -> list[Path]:
    """The image files of a folder, without hidden ones, in the order of the numbers in their names; raises
    ValueError if a picture is there in two formats.  A warning lists names of different forms."""
    names = [p for p in folder.iterdir() if p.suffix.lower() in IMAGE_SUFFIXES and p.name[0] != "."]
    names = sorted((p for p in names if not p.is_dir()), key=_numbers)
    stem, count = max(Counter(p.stem for p in names).items(), key=lambda item: item[1], default=("", 0))
    if count > 1:
        twice = ", ".join(p.name for p in names if p.stem == stem)
        raise ValueError(f"it has a picture in several formats, {twice}: keep one")
    forms = Counter("#".join(_numbers(p)[0][::2]) for p in names)
    if 1 < len(forms) < len(names):
        text = ", ".join(f"{form} ({count})" for form, count in forms.most_common(3))
        text = f"its pictures are named in {len(forms)} ways, {text}"
        warnings.warn(f"{folder}: {text}; keep one camera's, and no copies", stacklevel=6)
    return names


def _places(folder: Path, names: list[Path]) -> list[int]:
    """Where each picture stands in its row, from 0 on: as the numbers in their names say, of which some may
    be missing.  A warning says so."""
    in_row, parts = list(range(len(names))), [_numbers(p)[0] for p in names]
    columns = [c for c in zip(*(p[1::2] for p in parts), strict=False) if len(set(c)) > 1]
    if len(columns) != 1 or len({tuple(p[::2]) for p in parts}) > 1:
        return in_row
    steps = [b - a for a, b in zip(columns[0], columns[0][1:], strict=False)]
    step, count = Counter(steps).most_common(1)[0]
    if count == len(steps):
        return in_row
    if 2 * count < len(steps) or any(s < step or s % step for s in steps):
        text = "the numbers in its pictures' names are irregular, and not used"
        warnings.warn(f"{folder}: {text}; if they are times, write them to timestamps.txt", stacklevel=6)
        return in_row
    places = [int((number - columns[0][0]) / step) for number in columns[0]]
    k = next(k for k, s in enumerate(steps) if s > step)
    missing = places[-1] + 1 - len(names)
    text = f"{missing} numbers are missing among its pictures, the first after {names[k].name}"
    warnings.warn(f"{folder}: {text}; the times follow the numbers", stacklevel=6)
    return places


def _numbers(path: Path) -> tuple[list, str]:
    """A name's key: its texts and numbers by turns."""
    parts = re.split(r"([0-9]+(?:\.[0-9]+)?)", path.stem)
    return [Decimal(part) if k % 2 else part for k, part in enumerate(parts)], path.name


def read_image(path: Path) -> np.ndarray:
    """Read an image (H, W, 3) RGB, u8 or u16; raises ValueError, with the file's name, if it holds none."""
    try:
        return decode(regular_file(path, MAX_IMAGE_BYTES).read_bytes())
    except ValueError as error:
        raise ValueError(f"{path.name}: {error}") from None


def decode(content: bytes) -> np.ndarray:
    """Decode a file's bytes to an image (H, W, 3) RGB, u8 or u16; raises ValueError if they hold no image or
    one with too many pixels.

    The size is read before the pixels, because a megabyte can stand for gigapixels.
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
    """Read the frames of a video at the times that the file states, from its start; raises `InputError`."""
    _, first = next(_video_frames(path))
    frames, details = partial(_video_frames, path), partial(_video_details, path)
    return Source(path, first.shape[1::-1], frames=frames, details=details)


def _video_details(path: Path) -> dict:
    deg = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG).get(cv2.CAP_PROP_ORIENTATION_META)
    return {TURNED: int(deg)} if deg else {}


def _video_frames(path: Path):
    video = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    size = (video.get(k) for k in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
    if video.isOpened():
        check_image(*map(int, size))
    count, (more, bgr) = 0, video.read()
    if not more:
        raise ValueError("no frame can be decoded")
    while more:
        count += 1
        yield round(video.get(cv2.CAP_PROP_POS_MSEC) * 1000), cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB)
        more, bgr = video.read()
    stated = int(video.get(cv2.CAP_PROP_FRAME_COUNT))
    video.release()
    if count < stated:
        text = f"holds {count} of the {stated} images that its header promises"
        warnings.warn(
            f"{path}: {text}; unless its rate varies, it was cut or damaged: copy it again", stacklevel=2
        )
