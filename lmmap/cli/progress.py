"""What the ``lmmap`` command shows on a terminal: progress, counts, colours."""

from __future__ import annotations

import os
import sys
import time
from collections import Counter

from tqdm import tqdm

from ..recordings.stream import Stream
from ..types import Estimate, Status

GREEN, RED, PLAIN = "\033[32m", "\033[31m", "\033[0m"


def add_colour(text, colour: str, file=None) -> str:
    """The text, in colour if it goes to a terminal and NO_COLOR is not set."""
    file = file or sys.stdout
    return f"{colour}{text}{PLAIN}" if file.isatty() and not os.environ.get("NO_COLOR") else str(text)


def in_its_colour(text: str, status: str) -> str:
    """The text in the colour of a status, under the conditions of `add_colour`."""
    return add_colour(text, GREEN if status == Status.OK else RED)


class Bar(tqdm):
    """Progress in seconds of the recording, with the number of ``images`` so far and of those with a pose
    (``poses``).

    The bar is shown on a terminal only.
    """

    def __init__(self, stream: Stream, modality: str):
        span = stream.source.span_us
        form = "{desc}: {percentage:3.0f}%|{bar}| {n:.1f}/{total:.1f} s [{elapsed}<{remaining}{postfix}]"
        if span is None:
            form = "{desc}: {n:.1f} s [{elapsed}{postfix}]"
        total = (span[1] - span[0]) * 1e-6 if span else None
        super().__init__(desc=modality, total=total, bar_format=form, disable=None)
        self._first_us, self._began = span[0] if span else None, time.monotonic()
        self.images = self.poses = 0

    def add(self, estimate: Estimate) -> Estimate:
        """Count an image, advance to its time, and return the estimate."""
        self.images += 1
        self.poses += estimate.T_cam_port is not None
        self._first_us = estimate.t_us if self._first_us is None else self._first_us
        rate = self.images / max(time.monotonic() - self._began, 1e-9)
        text = f"{rate:.1f} images/s, {self.poses} of {self.images} with a pose"
        self.set_postfix_str(text, refresh=False)
        seconds = (estimate.t_us - self._first_us) * 1e-6
        self.update(max(0.0, (min(seconds, self.total) if self.total else seconds) - self.n))
        return estimate


def summary(counts: Counter[str]) -> str:
    """The number of images, and how many of them have each status."""
    each = (in_its_colour(f"{n} {status}", status) for status, n in sorted(counts.items()))
    return f"{counts.total()} images; " + ", ".join(each)
