"""A table of estimates that grows line by line, so that an interrupted run keeps its work and can go on."""

from __future__ import annotations

import csv
import hashlib
import io
import os
from contextlib import ExitStack, suppress
from pathlib import Path

from ..files import atomic, check_output, is_special, lock, open_special
from ..marks import as_mark, check_mark
from ..types import Estimate, InputError, Status
from .pose_files import COLUMNS, as_row, parse_estimates, parse_trajectory, tum_line

ENDS_BYTES = 2**20  # of a recording, at both ends, by which it is known again


class Journal:
    """Estimates on disk one by one, as ``csv`` (`read_estimates`) or ``tum`` (`read_trajectory`).

    Use it in a ``with`` block, which keeps other processes from the same file.  A file that is not resumed is
    replaced when the first estimate comes, not before.

    Parameters
    ----------
    made_of
        What the estimates depend on, kept beside them as ``NAME.made-of``.  Only a file that was made of the
        same is resumed.  None: the caller knows it by other means.
    resume
        Go on with a file that is there: ``done_us`` are the times of its estimates (``tum`` holds poses
        only), ``done`` the estimates by their times (``csv``).  A last line that was cut off is dropped.

    Raises
    ------
    InputError
        For what cannot be written, and for a file to resume that is not ours; it is not touched.
    """

    def __init__(self, path, format: str = "csv", resume: bool = False, made_of: dict | None = None):
        if format not in ("csv", "tum"):
            raise ValueError(f"format: expected 'csv' or 'tum', got {format!r}")
        self.path, self.format = check_output(path, overwrite=True), format
        self.statuses: list[str] = []
        self.done_us: list[int] = []
        self.done: dict[int, Estimate] = {}
        self._resume, self._made_of = resume, made_of
        self._file = None
        self._whole = 0  # bytes of whole lines to go on behind
        self._held = ExitStack()

    @property
    def mark(self) -> Path:
        """The file that says what the estimates were made of."""
        return self.path.with_name(self.path.name + ".made-of")

    def _read(self) -> None:
        """Take the times and statuses of the lines that are whole."""
        content = self.path.read_bytes()
        head = ",".join(COLUMNS).encode() + b"\n"
        if self._made_of is not None:
            begun = head[: len(content)] if self.format == "csv" else b""
            if not os.path.exists(self.mark) and content == begun:
                return  # killed before its mark had its name: no line to lose
            check_mark(self.path, self.mark, self._made_of)
        whole = content.rfind(b"\n") + 1
        if self.format == "csv" and not (content.startswith(head) or head.startswith(content)):
            raise InputError(f"{self.path}: has other columns than these; delete it, or give another name")
        try:
            text = content[:whole].decode()
        except UnicodeDecodeError:
            raise InputError(f"{self.path}: is no table of poses; delete it, or give another name") from None
        if not text.strip():
            return
        if self.format == "tum":
            self.done_us = parse_trajectory(text, self.path, "tum").t_us.tolist()
            self.statuses = ["ok"] * len(self.done_us)
        else:
            estimates = parse_estimates(text, self.path)
            self.done = {e.t_us: e for e in estimates}
            self.done_us, self.statuses = [e.t_us for e in estimates], [str(e.status) for e in estimates]
        self._whole = whole

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
            seen = estimate.status == Status.OK  # the format cannot say that a pose is a prediction
            self._write(tum_line(estimate.t_us, estimate.T_cam_port) if seen else "")
            return
        text = io.StringIO()
        csv.DictWriter(text, COLUMNS, lineterminator="\n").writerow(as_row(estimate))
        self._write(text.getvalue())

    def _write(self, text: str) -> None:
        try:
            if self._file is None:
                self._open()
            self._file.write(text)
            self._file.flush()
        except OSError as error:
            raise InputError(
                f"{self.path}: cannot write ({error.strerror}); make room, then go on: estimate with --resume"
            ) from None

    def _open(self) -> None:
        """Drop what is not to be kept, say what the file is made of, and open it for the next line."""
        if self._whole:
            self._file = self.path.open("r+", newline="")
            self._file.truncate(self._whole)
            self._file.seek(self._whole)
            return
        head = ",".join(COLUMNS) + "\n" if self.format == "csv" else ""
        if is_special(self.path):
            self._file = io.TextIOWrapper(open_special(self.path), newline="")
            self._file.write(head)
            return
        # on a full disk what was there stays; and a mark never stands beside another run's lines
        with ExitStack() as written:
            if self._made_of is not None:
                mark = written.enter_context(atomic(self.mark))
                mark.write_text(as_mark(self._made_of))
            with atomic(self.path) as lines:
                lines.write_text(head)
                self.mark.unlink(missing_ok=True)
        self._file = self.path.open("a", newline="")

    def __enter__(self):
        self._held.enter_context(lock(self.path))
        try:
            if self._resume and self.path.is_file():
                self._read()
        except BaseException:
            self._held.close()
            raise
        self._times = set(self.done_us)
        return self

    def __exit__(self, *_):
        if self._file is not None:
            with suppress(OSError):  # said when it was written
                self._file.close()
        self._held.close()


def recording_mark(path) -> dict:
    """Name, size and a hash by which a recording is known again; of long files the hash is of both ends.

    Of a folder they are its list's, and the number of files in it.
    """
    path = Path(path)
    if path.is_dir():
        lists = [
            path / name
            for name in ("timestamps.txt", "images.txt", "metadata.yaml")
            if (path / name).is_file()
        ]
        return {
            "name": path.name,
            "files": len(list(path.iterdir())),
            "list": [recording_mark(p) for p in lists],
        }
    size, digest = path.stat().st_size, hashlib.sha256()
    with path.open("rb") as file:
        digest.update(file.read(ENDS_BYTES))
        file.seek(max(0, size - ENDS_BYTES))
        digest.update(file.read(ENDS_BYTES))
    return {"name": path.name, "bytes": size, "sha256_of_ends": digest.hexdigest()}
