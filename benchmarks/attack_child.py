"""Run one command in a forked process, with limits, watch the files that it opens, and kill it if asked."""

from __future__ import annotations

import argparse
import fcntl
import json
import os
import re
import resource
import select
import signal
import sys
import tempfile
import time
import traceback
from pathlib import Path
from typing import NamedTuple

from lmmap.cli import main as command

# as the command does, before anything in this process, of which each child is a copy, has loaded FFmpeg
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
MOST_BYTES, HARD_BYTES, MOST_S, HARD_S, IDLE_S = 2**30, 3 * 2**30, 10.0, 20, 15.0
WRITES = (
    *("os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.truncate", "os.link", "os.symlink"),
    "shutil.rmtree",
)
FLAGS = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC
CACHES = (
    "__pycache__",
    "/dev/null",
    "torchinductor",
    "joblib_memmapping",
    "/.cache",
    "matplotlib",
)  # no files of ours
SAID = re.compile("lmmap: (note: |[0-9]+ images)")  # before an error: a note, and what `lmmap live` had
LEARNED = re.compile("(rgb|event): ")  # progress of `lmmap adapt`, a line each camera
OUTSIDE, NOBODY, PIPE_BYTES = 98, 65534, 2**20


class Answer(NamedTuple):
    """Exit code (negative: a signal), stderr, memory beyond that of the idle process, CPU and wall time,
    files read below the folder, number of writes, and arguments that the command used."""

    code: int
    err: str
    bytes: int
    seconds: float
    wall_s: float
    reads: list[str]
    writes: int
    used: list[str]

    @property
    def fault(self) -> str:
        """The fault of an answer that no command may give, or nothing."""
        lines = [line for line in self.err.splitlines() if line.strip() and not LEARNED.match(line)]
        last = lines[-1][:300] if lines else ""
        if "Traceback" in self.err or "Exception ignored" in self.err:
            return f"traceback: {last}"
        if self.code not in (0, 1, 2):
            return f"ended by {self.code} after {self.wall_s:.0f} s: {last}"
        errors = [line for line in lines if not SAID.match(line)]
        if self.code == 1 and (len(errors) != 1 or len(lines) > 2 or not last.startswith("lmmap: ")):
            return f"{len(lines)} lines: " + " | ".join(line[:150] for line in lines[:4])
        if self.code == 2 and not last.startswith("lmmap"):
            return f"usage without a reason: {last}"
        if noise := [line for line in lines if "Warning" in line or (not self.code and "rror:" in line)]:
            return f"noise: {noise[0][:200]}"
        if self.bytes > MOST_BYTES:
            return f"{self.bytes / 2**20:.0f} MB"
        return f"{self.seconds:.1f} s" if self.seconds > MOST_S else ""


class Watch:
    """Counts what this process writes, kills it before a write, and ends it before one outside its folder."""

    def __init__(self, folder: Path, kill_at: int | None):
        self.folder, self.kill_at = str(folder), kill_at
        self.reads, self.writes = {}, 0

    def __call__(self, event: str, facts: tuple) -> None:
        if event not in ("open", *WRITES) or isinstance(facts[0], int):
            return
        for path in (os.path.abspath(os.fsdecode(p)) for p in facts[: 2 if event == "os.rename" else 1]):
            inside = path.startswith(self.folder)
            if event == "open" and not (facts[2] or 0) & FLAGS:
                self.reads |= {os.path.relpath(path, self.folder): None} if inside else {}
            elif inside:
                self.writes += 1
                if self.writes == self.kill_at:
                    os.kill(os.getpid(), signal.SIGKILL)
            elif not any(part in path for part in (*CACHES, tempfile.gettempdir())):
                os.write(2, f"lmmap: wrote outside its folder: {path}\n".encode())
                os._exit(OUTSIDE)


def used_bytes(which: int) -> int:
    """Memory of this process: its address space (0) or its resident set (1)."""
    return int(Path("/proc/self/statm").read_text().split()[which]) * resource.getpagesize()


def _worked(process: int) -> list[str]:
    """CPU time of a process."""
    return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[11:13]


def answer(argv: list[str], folder: Path, *, kill_at: int | None = None, kill_after_s: float | None = None,
           stdout: str | None = os.devnull, most_bytes: int | None = None,
           nobody: bool = False) -> Answer:  # fmt: skip
    """Run ``lmmap`` in a folder.

    It is killed before its write number ``kill_at``, or after ``kill_after_s``.  ``stdout`` is a file name;
    None closes it.  Files cannot grow beyond ``most_bytes``, as on a full disk.  ``nobody`` runs it as a user
    without root's permissions.
    """
    sys.stdout.flush()
    began = time.monotonic()
    (err, err_end), (told, told_end) = os.pipe(), os.pipe()  # files would be limited too
    for end in (err, told):
        fcntl.fcntl(end, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
    if not (child := os.fork()):
        _run(argv, folder, err_end, told_end, kill_at, stdout, most_bytes, nobody)
    ended, poll = os.pidfd_open(child), select.poll()
    poll.register(ended, select.POLLIN)
    last, patience_s = None, kill_after_s or IDLE_S
    while not poll.poll(1000 * patience_s) and last != (last := _worked(child)) and not kill_after_s:
        pass  # on a busy machine it may take long
    try:
        os.killpg(child, signal.SIGKILL)
    except ProcessLookupError:
        os.kill(child, signal.SIGKILL)
    _, status, used = os.wait4(child, 0)
    for end in (ended, err_end, told_end):
        os.close(end)
    with open(err, errors="replace") as said, open(told) as facts:
        text, (idle, *facts) = said.read(), json.loads(facts.read() or "[0, [], 0, []]")  # if it was killed
    above, seconds = used.ru_maxrss * 1024 - idle if idle else 0, used.ru_utime + used.ru_stime
    wall_s = time.monotonic() - began
    return Answer(os.waitstatus_to_exitcode(status), text, max(0, above), seconds, wall_s, *facts)


def _run(argv, folder, err, told, kill_at, stdout, most_bytes, nobody) -> None:
    """The child's side of `answer`; never returns."""
    code, used, idle, watch = 99, set(), used_bytes(1), Watch(folder, kill_at)
    try:
        os.setsid()
        os.chdir(folder)
        for stream, target in enumerate((os.devnull, stdout or os.devnull)):
            os.dup2(os.open(target, os.O_RDWR), stream)
        os.dup2(err, 2)
        sys.stdout, sys.stderr = open(1, "w"), open(2, "w", 1, errors="backslashreplace")  # noqa: SIM115
        if stdout is None:  # as Python finds it then
            sys.stdout = sys.stdout.close()
        limits = {resource.RLIMIT_AS: used_bytes(0) + HARD_BYTES, resource.RLIMIT_CORE: 0}
        limits |= {resource.RLIMIT_CPU: HARD_S}
        limits |= {resource.RLIMIT_FSIZE: most_bytes} if most_bytes else {}
        for kind, limit in limits.items():
            resource.setrlimit(kind, (limit, limit))
        tempfile.tempdir = str(folder.with_name("temporary"))
        if nobody:
            os.setresuid(NOBODY, NOBODY, NOBODY)
        run = command.call

        def looked_at(a, name):
            used.add(name)
            return object.__getattribute__(a, name)

        def call(what, function, a):  # what the parser itself looks at does not count
            argparse.Namespace.__getattribute__ = looked_at
            return run(what, function, a)

        command.call = call
        sys.addaudithook(watch)
        code = command.main(argv)
        if sys.stdout:  # as Python's end does
            sys.stdout.flush()
    except SystemExit as stop:
        code = stop.code if isinstance(stop.code, int) else 1
    except BrokenPipeError:
        pass
    except BaseException:
        traceback.print_exc()
    finally:
        facts = [idle, list(watch.reads), watch.writes, sorted(used)]
        os.write(told, json.dumps(facts).encode())
        os._exit(code)
