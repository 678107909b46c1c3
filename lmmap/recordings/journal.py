"""A table of estimates that grows line by line, so that an interrupted run keeps its work and can resume."""

from __future__ import annotations

import csv
import hashlib
import io
import os
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

from ..disk import tidy
from ..files import check_output, is_special, lock, open_special, write_text, writes
from ..marks import as_mark, check_mark
from ..types import Estimate, InputError, Status
from .pose_files import COLUMNS, as_row, parse_estimates, parse_trajectory, tum_line

LISTS = ("timestamps.txt", "images.txt", "metadata.yaml")  # of a folder
PART = ".lmmap-part"  # how the name of an unfinished file ends
ENDS_BYTES = 2**20  # of a recording, at both ends, by which it is known again


class Journal:
    """Write estimates to disk one by one, as ``csv`` (`read_estimates`) or ``tum`` (`read_trajectory`).

    Use it in a ``with`` block, which keeps other processes from the same file.  A file that is not resumed
    stays until the block ends without an error; until then the estimates are in ``NAME.lmmap-part``, where a
    resumed run continues.

    Parameters
    ----------
    made_of
        What the estimates depend on, kept beside them in a file whose name ends in ``.made-of``.  Only a file
        that was made from the same is resumed.  None: the caller checks this by other means.
    resume
        Continue an existing file: ``done_us`` are the times of its estimates (``tum`` holds poses only),
        ``done`` the estimates by their times (``csv``).  An incomplete last line is dropped.

    Attributes
    ----------
    kept_in : Path
        The file that holds the estimates until the block ends.
    is_whole : bool
        Set it to False if estimates are missing, so that an older file stays.

    Raises
    ------
    InputError
        If the file cannot be written, or the file to resume is not ours; that file is not touched.
    ValueError
        If ``format`` is neither ``csv`` nor ``tum``.
    """

    def __init__(self, path, format: str = "csv", resume: bool = False, made_of: dict | None = None):
        if format not in ("csv", "tum"):
            raise ValueError(f"format: expected 'csv' or 'tum', got {format!r}")
        self.path, self.format = check_output(path, overwrite=True), format
        self._target = Path(os.path.realpath(path)) if self.path.is_symlink() else self.path
        self.kept_in = self._target
        self._part = self._target.with_name(self._target.name + PART)
        self.is_whole = True
        self.statuses: list[str] = []
        self.done_us: list[int] = []
        self.done: dict[int, Estimate] = {}
        self._resume, self._made_of = resume, made_of
        self._file: Any = None  # of text, once it is open
        self._whole = 0  # bytes of whole lines to go on behind

    def _read(self) -> None:
        """Take the times and statuses of the lines that are whole."""
        content = self.kept_in.read_bytes()
        head = ",".join(COLUMNS).encode() + b"\n"
        if self._made_of is not None:
            check_mark(self.kept_in, _mark_of(self.kept_in), self._made_of)
        self._whole = content.rfind(b"\n") + 1
        if self.format == "csv" and not (content.startswith(head) or head.startswith(content)):
            raise InputError(f"{self.kept_in}: has other columns than these; delete it, or give another name")
        text = content[: self._whole].decode(errors="replace")
        if not text.strip():
            self._whole = 0
        elif self.format == "tum":
            self.done_us = parse_trajectory(text, self.kept_in, "tum").t_us.tolist()
            self.statuses = ["ok"] * len(self.done_us)
        else:
            estimates = parse_estimates(text, self.kept_in)
            self.done = {e.t_us: e for e in estimates}
            self.done_us, self.statuses = [e.t_us for e in estimates], [str(e.status) for e in estimates]

    def has(self, *times_us: int) -> bool:
        """Whether the image that is estimated at one of these times (us) is done; raises `InputError` if its
        neighbours are, but it is not."""
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
        try:
            if self._file is None:
                self._open()
            if self.format == "csv":
                csv.DictWriter(self._file, COLUMNS, lineterminator="\n").writerow(as_row(estimate))
            elif estimate.status == Status.OK:  # the format cannot say that a pose is a prediction
                assert estimate.T_cam_port is not None
                self._file.write(tum_line(estimate.t_us, estimate.T_cam_port))
            self._file.flush()
        except OSError as error:
            raise InputError(
                f"{self.path}: cannot write ({error.strerror}); free some space, then continue with --resume"
            ) from None

    def _open(self) -> None:
        """Drop what is not to be kept, say what the file is made of, and open it for the next line."""
        if self._whole:
            self._file = self.kept_in.open("r+", newline="")
            self._file.truncate(self._whole)
            self._file.seek(self._whole)
            return
        head = ",".join(COLUMNS) + "\n" if self.format == "csv" else ""
        if is_special(self.path):
            self._file = io.TextIOWrapper(open_special(self.path), newline="")
            self._file.write(head)
            return
        # what a run left that was killed goes; and no mark stands beside another run's lines
        ours = self._part, _mark_of(self._part), _mark_of(self.kept_in)
        for path in (*ours, _mark_of(self._target)):
            if os.path.lexists(path) and not (path.is_file() or path.is_symlink()):
                raise InputError(f"{path}: is no file of ours; move it away, or give another output")
        for path in ours:
            path.unlink(missing_ok=True)
        if self._made_of is not None:
            write_text(_mark_of(self.kept_in), as_mark(self._made_of))
        self._file = self.kept_in.open("w", newline="")
        self._file.write(head)

    def __enter__(self):
        with ExitStack() as held:
            held.enter_context(lock(self.path))
            on_disk = not is_special(self.path)
            if self._made_of is not None and on_disk:
                for kept_in in (self._part, self._target):
                    tidy(_mark_of(kept_in))
            there = on_disk and os.path.exists(self._part if self._resume else self.path)
            self.kept_in = self._part if there else self._target
            if self._resume and self.kept_in.is_file():
                self._read()
            self._held = held.pop_all()
        self._times = set(self.done_us)
        return self

    def __exit__(self, error, *_):
        with self._held:
            if self._file is not None:
                with suppress(OSError):  # said when it was written
                    self._file.close()
            begun = self._file is not None or self._whole
            if self.kept_in == self._part and begun and error is None and self.is_whole:
                with writes(self.path):
                    _mark_of(self._target).unlink(missing_ok=True)
                    os.replace(self._part, self._target)
                    if self._made_of is not None:
                        os.replace(_mark_of(self._part), _mark_of(self._target))


def _mark_of(path: Path) -> Path:
    """The file that says what the estimates in another one were made of."""
    return path.with_name(path.name + ".made-of")


def recording_mark(path) -> dict:
    """Name, size and hash that identify a recording; for long files, only both ends are hashed.

    For a folder, those of its list of times, and the number of files in it.
    """
    path = Path(path)
    if path.is_dir():
        marks = [recording_mark(path / name) for name in LISTS if (path / name).is_file()]
        return {"name": path.name, "files": len(list(path.iterdir())), "list": marks}
    size, digest = path.stat().st_size, hashlib.sha256()
    with path.open("rb") as file:
        digest.update(file.read(ENDS_BYTES))
        file.seek(max(0, size - ENDS_BYTES))
        digest.update(file.read(ENDS_BYTES))
    return {"name": path.name, "bytes": size, "sha256_of_ends": digest.hexdigest()}
