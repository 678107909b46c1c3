"""Videos, picture by picture."""

from __future__ import annotations

import errno
import sys
from contextlib import ExitStack
from pathlib import Path

import cv2
import numpy as np

from ..files import atomic, check_folder_of, writes
from ..types import InputError

CODECS = {".mp4": "vp09", ".avi": "MJPG"}  # VP9, which browsers play; OpenCV's wheels have no H.264


class Video:
    """A video that grows picture by picture; use it in ``with``.

    An error or an interruption ends it after its last picture, or leaves an older video of this name.

    Parameters
    ----------
    path
        Its name, which ends in .mp4 or .avi.

    Raises
    ------
    InputError
        For a name that ends otherwise, and what cannot be written.
    """

    def __init__(self, path: Path):
        if path.suffix.lower() not in CODECS:
            raise InputError(f"{path}: cannot write '{path.suffix}'; name the video .mp4 or .avi")
        check_folder_of(path)
        self.path, self._part, self._writer, self._pictures = path, path, None, 0

    def add(self, picture: np.ndarray, rate_hz: float) -> None:
        """Write the next picture (H, W, 3) u8 RGB; the first one sets size and rate."""
        if self._writer is None:
            self._part = self._held.enter_context(atomic(self.path, keep=True))
            fourcc, size_px = cv2.VideoWriter_fourcc(*CODECS[self.path.suffix.lower()]), picture.shape[1::-1]
            self._writer = cv2.VideoWriter(str(self._part), cv2.CAP_FFMPEG, fourcc, rate_hz, size_px)
            if not self._writer.isOpened():
                raise InputError(f"{self.path}: cannot write a video there; choose a folder with room")
        self._writer.write(picture[..., ::-1])
        self._pictures += 1

    def _end(self) -> None:
        """`OSError` unless the video holds all its pictures; OpenCV is silent on a full disk."""
        if self._writer is None:
            return
        self._writer.release()
        whole = cv2.VideoCapture(str(self._part), cv2.CAP_FFMPEG)
        if whole.get(cv2.CAP_PROP_FRAME_COUNT) != self._pictures:
            raise OSError(errno.ENOSPC, "not all pictures")

    def __enter__(self):
        self._held = ExitStack()
        self._held.enter_context(writes(self.path))
        return self

    def __exit__(self, *error):
        try:
            self._end()
        except Exception:
            error = sys.exc_info()
            raise
        finally:
            self._held.__exit__(*error)
