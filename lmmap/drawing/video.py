"""Videos, picture by picture; an interrupted one can be gone on with."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import cv2
import numpy as np

from ..files import atomic, check_folder_of, lock, writes
from ..marks import MARK, as_mark, begin_folder, check_mark, check_own, remove_folder
from ..types import InputError

CODECS = {".mp4": "vp09", ".avi": "MJPG"}  # VP9, which browsers play; OpenCV's wheels have no H.264
SEGMENT = 48  # pictures, four of the encoder's groups; a killed run loses fewer than these
NO_INTERVAL = 10**6  # of pictures between key frames; else each counts as one, and browsers give up


class Video:
    """A video that grows picture by picture; use it in ``with``.

    Parameters
    ----------
    path
        Its name, which ends in .mp4 or .avi.
    made_of
        What the pictures depend on, as JSON, for a video that can be resumed.  Its segments are kept in the
        folder ``NAME.parts`` until they are joined, which needs no second encoding.  None: an error ends the
        video after its last picture, or leaves the older one.
    resume
        Go on with the segments that are there: ``kept`` is the number of their pictures.

    Raises
    ------
    InputError
        For a name that ends otherwise, what cannot be written, and segments that were made of something else.
    """

    def __init__(self, path: Path, made_of: dict | None = None, resume: bool = False):
        if path.suffix.lower() not in CODECS:
            raise InputError(f"{path}: cannot write '{path.suffix}'; name the video .mp4 or .avi")
        check_folder_of(path)
        self.path, self.kept = path, 0
        self._made_of, self._resume = made_of, resume
        self.goes_on = made_of is not None  # an error leaves segments to go on with
        self.folder = path.with_name(path.name + ".parts")  # of the segments
        self._begun = self.folder / f"begun{path.suffix}" if self.goes_on else path
        self._writer, self._pictures = None, 0

    @property
    def _segments(self) -> list[Path]:
        """Segments that are whole, named by their first picture and their number of pictures."""
        return sorted(self.folder.glob("[0-9]*-[0-9]*.*"))

    def add(self, picture: np.ndarray, rate_hz: float) -> None:
        """Write the next picture (H, W, 3) u8 RGB; the first one sets size and rate."""
        if self._writer is None:
            if not self.goes_on:
                self._begun = self._held.enter_context(atomic(self.path, keep=True))
            self._writer = _writer(self._begun, rate_hz, picture.shape[1::-1])
        self._writer.write(picture[..., ::-1])
        self._pictures += 1
        if self.goes_on and self._pictures == SEGMENT:
            self._end_segment()

    def _end_segment(self) -> None:
        if self._writer is None:
            return
        self._writer.release()
        count, self._writer, self._pictures = self._pictures, None, 0
        _check_count(self._begun, count)
        if self.goes_on:
            first = sum(_count(segment) for segment in self._segments)
            os.replace(self._begun, self.folder / f"{first:06}-{count:06}{self.path.suffix}")

    def _join(self) -> None:
        segments = self._segments
        if segments:
            with atomic(self.path) as temporary:
                join(segments, temporary)
        remove_folder(self.folder)

    def __enter__(self):
        with ExitStack() as held:
            held.enter_context(writes(self.path))
            if self.goes_on:
                held.enter_context(lock(self.path))
                if self._resume and self.folder.exists():
                    check_own(self.folder)
                    check_mark(self.folder, self.folder / MARK, self._made_of)
                else:
                    begin_folder(self.folder, as_mark(self._made_of))
                self.kept = sum(_count(segment) for segment in self._segments)
            self._held = held.pop_all()
        return self

    def __exit__(self, *error):
        try:
            self._end_segment()
            if self.goes_on and error[0] is None:
                self._join()
        except Exception:
            error = sys.exc_info()
            raise
        finally:
            self._held.__exit__(*error)


def join(segments: list[Path], path: Path) -> None:
    """Join videos of one codec, size and rate, without encoding them anew."""
    first = cv2.VideoCapture(str(segments[0]), cv2.CAP_FFMPEG)
    size_px = tuple(int(first.get(p)) for p in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
    rate_hz = first.get(cv2.CAP_PROP_FPS)
    raw = [cv2.VIDEOWRITER_PROP_RAW_VIDEO, 1, cv2.VIDEOWRITER_PROP_KEY_INTERVAL, NO_INTERVAL]
    whole, count = _writer(path, rate_hz, size_px, raw), 0
    for packet, is_key in (p for segment in segments for p in packets(segment)):
        count += 1
        whole.set(cv2.VIDEOWRITER_PROP_KEY_FLAG, int(is_key))
        whole.write(packet)
    whole.release()
    _check_count(path, count)


def packets(path: Path) -> Iterator[tuple[np.ndarray, bool]]:
    """The encoded pictures of a video, and whether each is a key frame, at which a player can begin."""
    video = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG, [cv2.CAP_PROP_FORMAT, -1])
    while (packet := video.read())[0]:
        yield packet[1], bool(video.get(cv2.CAP_PROP_LRF_HAS_KEY_FRAME))


def _count(segment: Path) -> int:
    return int(segment.stem.split("-")[1])


def _check_count(path: Path, count: int) -> None:
    """`OSError` unless a written video holds so many pictures; OpenCV is silent on a full disk."""
    if cv2.VideoCapture(str(path), cv2.CAP_FFMPEG).get(cv2.CAP_PROP_FRAME_COUNT) != count:
        raise OSError(errno.ENOSPC, "not all pictures")


def _writer(path: Path, rate_hz: float, size_px: tuple, options=()) -> cv2.VideoWriter:
    fourcc = cv2.VideoWriter_fourcc(*CODECS[path.suffix.lower()])
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, fourcc, rate_hz, size_px, list(options))
    if not writer.isOpened():
        raise InputError(f"{path}: cannot write a video there; choose a folder with room")
    return writer
