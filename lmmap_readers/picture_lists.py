"""Folders of images with a list of their times, as in RPG's data sets."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from lmmap.files import read_text
from lmmap.recordings.formats import METADATA, suffixes
from lmmap.recordings.images import IMAGE_SUFFIXES, TIME_LISTS, pictures_in, sequence
from lmmap.recordings.stream import Source, reader
from lmmap.types import InputError

from .tables import read_text as read_events
from .time_units import GuessedSteps, microseconds

MAX_LIST_BYTES = 2**26  # of an image folder's list: a million images


@reader(
    "not a folder of images",
    "give images and a timestamps.txt with a time for each, or --fps, or name one recording",
    (cv2.error,),
)
def read(path: Path, time_unit: str | None = None) -> Source:
    """Read images and ``timestamps.txt`` or ``images.txt``, a line each: ``t`` (names sorted) or ``t name``.

    Times are in the unit that is given, else in seconds if any has a decimal point, else in microseconds; an
    ``events.txt`` beside them is read too.  Raises `InputError`.
    """
    _check_folder(path)
    names, t = _list_pictures(path)
    source = sequence(path, names, [int(t_us) for t_us in microseconds(t, time_unit).tolist()])
    source = replace(source, guessed=None if time_unit else GuessedSteps.of(t))
    beside = path / "events.txt"
    return (
        replace(source, events=lambda: read_events(beside, time_unit).events()) if beside.exists() else source
    )


def _list_pictures(path: Path) -> tuple[list[Path], np.ndarray]:
    """The folder's images and their times (N,), as its list states them."""
    lists = [path / name for name in TIME_LISTS if (path / name).is_file()]
    if not lists:
        raise ValueError("no timestamps.txt or images.txt in it")
    lines = [line.split() for line in read_text(lists[0], MAX_LIST_BYTES).splitlines()]
    lines = [line for line in lines if line and not line[0].startswith("#")]
    if all(len(line) == 1 for line in lines):
        names = pictures_in(path)
    elif any(len(line) == 1 for line in lines):
        raise ValueError(f"{lists[0].name} has lines with and without a name")
    else:
        names = [path / line[1] for line in lines]
    if len(names) != len(lines) or not names:
        raise ValueError(f"{len(names)} images for {len(lines)} times")
    whole = all(re.fullmatch("[-+]?[0-9]+", line[0]) for line in lines)
    return names, np.array([line[0] for line in lines], np.int64 if whole else float)


def _check_folder(path: Path) -> None:
    """`InputError` for a folder of recordings, but no pictures."""
    names = sorted(p.name for p in path.iterdir())
    pictures = (*IMAGE_SUFFIXES, ".txt", ".csv")
    if any(name.lower().endswith(pictures) for name in names):
        return
    if recordings := [name for name in names if Path(name).suffix.lower() in suffixes()]:
        remedy = f"name one of them, such as {path / recordings[0]}"
        if recordings[0].endswith((".db3", ".mcap")):
            missing = f"if it is a ROS 2 bag, its {METADATA} is missing"
            remedy = f"{missing}: run ros2 bag reindex {path}, or {remedy}"
        raise InputError(f"{path}: a folder of {len(recordings)} recordings, not of images; {remedy}")
