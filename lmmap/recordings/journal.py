"""A table of estimates that grows line by line, so that an interrupted run keeps its work and can go on."""

from __future__ import annotations

import csv
import io
import os
from contextlib import suppress
from pathlib import Path

from ..types import Estimate, InputError
from .pose_files import COLUMNS, as_row, read_estimates, read_trajectory, tum_line


class Journal:
    """Estimates on disk one by one, as ``csv`` (`read_estimates`) or ``tum`` (`read_trajectory`).

    Without ``resume``, a file of that name is replaced when the first estimate comes, not before.  With it,
    ``done_us`` are the times of the estimates that are there already (``tum`` holds poses only), ``done`` the
    estimates by their times (``csv``); a last line that was cut off is dropped.  Use it in a ``with`` block;
    raises `InputError` for what cannot be written.
    """

    def __init__(self, path, format: str = "csv", resume: bool = False):
        if format not in ("csv", "tum"):
            raise ValueError(f"format: expected 'csv' or 'tum', got {format!r}")
        self.path, self.format = Path(path), format
        self.statuses: list[str] = []
        self.done_us: list[int] = []
        self.done: dict[int, Estimate] = {}
        self._file = None
        folder = self.path.parent
        if not folder.is_dir():
            raise InputError(f"{path}: no folder {folder}; make it first")
        if self.path.is_dir():
            raise InputError(f"{path}: is a folder; give the name of a file")
        if not os.access(self.path if self.path.exists() else folder, os.W_OK):
            raise InputError(f"{path}: cannot write there; choose a folder that you may write")
        self._whole = self._read() if resume and self.path.exists() else None

    def _read(self) -> int:
        """Length in bytes of the whole lines, whose times and statuses are taken."""
        content = self.path.read_bytes()
        whole = content.rfind(b"\n") + 1
        if not content[:whole].strip():
            return 0
        if whole < len(content):  # what a killed process left behind
            with self.path.open("r+b") as file:
                file.truncate(whole)
        if self.format == "tum":
            self.done_us = read_trajectory(self.path, "tum").t_us.tolist()
            self.statuses = ["ok"] * len(self.done_us)
            return whole
        if content[:whole].decode(errors="replace").splitlines()[0] != ",".join(COLUMNS):
            raise InputError(f"{self.path}: has other columns than this version's; leave --resume out")
        found = read_estimates(self.path)
        self.done = {e.t_us: e for e in found}
        self.done_us, self.statuses = [e.t_us for e in found], [str(e.status) for e in found]
        return whole

    def has(self, *times_us: int) -> bool:
        """Whether an image is done that is estimated at one of these times; `InputError` if its neighbours
        are, but it is not."""
        if not self.done_us or min(times_us) > self.done_us[-1]:
            return False
        if self.format == "csv" and self._times.isdisjoint(times_us):
            raise InputError(
                f"{self.path}: holds estimates of other images than these; "
                "resume with the same recording, modality, --rate and --events, or leave --resume out"
            )
        return True

    def add(self, estimate: Estimate) -> None:
        """Write one estimate; it is on disk when this returns."""
        self.statuses.append(str(estimate.status))
        if self.format == "tum":
            T = estimate.T_cam_port
            self._write("" if T is None else tum_line(estimate.t_us, T))
            return
        text = io.StringIO()
        csv.DictWriter(text, COLUMNS, lineterminator="\n").writerow(as_row(estimate))
        self._write(text.getvalue())

    def _write(self, text: str) -> None:
        try:
            if self._file is None:
                self._file = self.path.open("a" if self._whole else "w", newline="")
                if self.format == "csv" and not self._whole:
                    self._file.write(",".join(COLUMNS) + "\n")
            self._file.write(text)
            self._file.flush()
        except OSError as error:
            raise InputError(
                f"{self.path}: cannot write ({error.strerror}); make room, then go on with --resume"
            ) from None

    def __enter__(self):
        self._times = set(self.done_us)
        return self

    def __exit__(self, *_):
        if self._file is not None:
            with suppress(OSError):  # said when it was written
                self._file.close()
