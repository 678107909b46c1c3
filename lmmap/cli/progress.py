"""What the ``lmmap`` command shows in a terminal: progress, counts, colours."""

from __future__ import annotations

import os
import sys
import time
from collections import Counter

from tqdm import tqdm

from ..recordings.stream import Stream

GREEN, RED, PLAIN = "\033[32m", "\033[31m", "\033[0m"


def add_colour(text, colour: str, file=None) -> str:
    """The text, in colour if it goes to a terminal and NO_COLOR is not set."""
    file = file or sys.stdout
    return f"{colour}{text}{PLAIN}" if file.isatty() and not os.environ.get("NO_COLOR") else str(text)


class Bar(tqdm):
    """Progress in seconds of the recording, with images per second and detections.

    It is shown on a terminal only.
    """

    def __init__(self, stream: Stream, modality: str):
        span = stream.source.span_us
        form = "{desc}: {percentage:3.0f}%|{bar}| {n:.1f}/{total:.1f} s [{elapsed}<{remaining}{postfix}]"
        if span is None:
            form = "{desc}: {n:.1f} s [{elapsed}{postfix}]"
        total = (span[1] - span[0]) * 1e-6 if span else None
        super().__init__(desc=modality, total=total, bar_format=form, disable=None)
        self._first_us, self._began = span[0] if span else None, time.monotonic()

    def show(self, t_us: int, images: int, poses: int) -> None:
        """Advance to the time of an image, of so many images and poses."""
        self._first_us = t_us if self._first_us is None else self._first_us
        rate = images / max(time.monotonic() - self._began, 1e-9)
        self.set_postfix_str(f"{rate:.1f} images/s, {poses} of {images} with a pose", refresh=False)
        seconds = (t_us - self._first_us) * 1e-6
        self.update(max(0.0, (min(seconds, self.total) if self.total else seconds) - self.n))


def summary(statuses: list[str]) -> str:
    """The number of images, and of each status among them."""
    counts = Counter(statuses)
    return f"{len(statuses)} images; " + ", ".join(
        add_colour(f"{n} {status}", GREEN if status == "ok" else RED) for status, n in sorted(counts.items())
    )
