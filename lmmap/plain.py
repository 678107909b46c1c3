"""Plain files: RPG's text of events, a folder of images with their times, a video."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from .core import InputError
from .events import from_columns

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
NO_FRAMES = None, np.zeros(0, np.int64), None


def read_text(path: Path):
    """Events of lines ``t x y p``: seconds where they have a decimal point, else microseconds."""
    try:
        return _text_events(path), *NO_FRAMES
    except (OSError, ValueError, OverflowError) as error:
        remedy = "expected lines 't x y p' with t in seconds, or in whole microseconds"
        raise InputError(f"{path}: not events as text ({_first_line(error)}); {remedy}") from None


def _text_events(path: Path) -> np.ndarray:
    table = pd.read_csv(path, sep=r"\s+", header=None, comment="#", names=["t", "x", "y", "p", "more"],
                        index_col=False)  # fmt: skip
    if table["more"].notna().any() or any(table[name].dtype.kind not in "if" for name in "txyp"):
        raise ValueError("a line does not hold four numbers")
    return from_columns(*(table[n].to_numpy() for n in "txyp"), seconds=table["t"].dtype.kind == "f")


def read_folder(path: Path):
    """Images and ``timestamps.txt`` or ``images.txt``: a line each, ``t`` (names sorted) or ``t name``.

    Times as in `read_text`; an ``events.txt`` beside them is read too, as in RPG's data sets.
    """
    try:
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
        frames = [_image(name) for name in names]
        if len({f.shape for f in frames}) != 1:
            raise ValueError("images of different sizes")
        text = path / "events.txt"
        events = _text_events(text) if text.exists() else from_columns([], [], [], [])
        return events, np.array(frames), np.array(t_us, np.int64), frames[0].shape[1::-1]
    except (OSError, ValueError, IndexError, OverflowError, cv2.error) as error:
        remedy = "give images and a timestamps.txt with a time for each, or name one recording"
        raise InputError(f"{path}: not a folder of images ({_first_line(error)}); {remedy}") from None


def _image(path: Path) -> np.ndarray:
    bgr = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_COLOR)
    if bgr is None:
        raise ValueError(f"{path.name} is not an image")
    return cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB)


def read_video(path: Path):
    """Frames of a video at the times that the file states, from its start."""
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # we say ourselves what is wrong, in one line
    video = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    frames, t_us = [], []
    while True:
        more, bgr = video.read()
        if not more:
            break
        frames.append(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB))
        t_us.append(round(video.get(cv2.CAP_PROP_POS_MSEC) * 1000))
    video.release()
    if not frames:
        raise InputError(f"{path}: no frame of this video can be decoded; convert it to MP4 or copy it again")
    events = from_columns([], [], [], [])
    return events, np.array(frames), np.array(t_us, np.int64), frames[0].shape[1::-1]


def _first_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0]
