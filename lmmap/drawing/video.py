"""Write videos frame by frame."""

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
    """A video written frame by frame in a ``with`` block.

    After an error or an interruption it holds the frames so far; an older video of that name is kept instead.

    Parameters
    ----------
    path
        The video's file name, ending in .mp4 or .avi.

    Raises
    ------
    InputError
        If the name ends otherwise, or the file cannot be written.
    """

    def __init__(self, path: Path):
        if path.suffix.lower() not in CODECS:
            raise InputError(f"{path}: cannot write '{path.suffix}'; name the video .mp4 or .avi")
        check_folder_of(path)
        self.path, self._part, self._pictures = path, path, 0
        self._writer: cv2.VideoWriter | None = None

    def add(self, picture: np.ndarray, rate_hz: float) -> None:
        """Write the next frame (H, W, 3) u8 RGB; the first one sets size and rate."""
        if self._writer is None:
            self._part = self._held.enter_context(atomic(self.path, keep=True))
            fourcc, size_px = cv2.VideoWriter.fourcc(*CODECS[self.path.suffix.lower()]), picture.shape[1::-1]
            self._writer = cv2.VideoWriter(str(self._part), cv2.CAP_FFMPEG, fourcc, rate_hz, size_px)
            if not self._writer.isOpened():
                raise InputError(f"{self.path}: cannot write a video there; choose a folder with room")
        self._writer.write(picture[..., ::-1])
        self._pictures += 1

    def _end(self) -> None:
        """Close the video; `OSError` if frames are missing, since OpenCV does not report a full disk."""
        if self._writer is None:
            return
        self._writer.release()
        whole = cv2.VideoCapture(str(self._part), cv2.CAP_FFMPEG)
        if whole.get(cv2.CAP_PROP_FRAME_COUNT) != self._pictures:
            raise OSError(errno.ENOSPC, "frames are missing")

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
