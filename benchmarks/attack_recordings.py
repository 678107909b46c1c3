"""Attack every command with damaged and hostile files, and count what it answers.

    python benchmarks/attack_recordings.py [CASES] [SEED] [--formats NAMES] [--only NAMES] [--keep FOLDER]
    python benchmarks/attack_recordings.py --sum OUTPUT [OUTPUT ...]

A case is a command on a file: a sound one with a structured mutation of its format, or a directed attack on
one promise of it.  Each runs in a process of its own, forked from one that has imported everything, under
limits of memory and time.  A sound answer is exit 0 or 1, at most two lines on stderr, no traceback, no
signal, at most 1 GB above the idle process and at most 10 s of the processor.  Prints each violation, and a
table of commands and formats, also when it is interrupted; ends with 1 if there is a violation.
"""

from __future__ import annotations

import os

# before torch is imported: a forked process would wait for ever for its parent's threads
os.environ["OMP_NUM_THREADS"] = "1"

import argparse
import collections
import functools
import hashlib
import io
import json
import resource
import select
import shutil
import signal
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from attack_cases import Case, cases, commands, every_sound_file

from lmmap.cli import main as command

MOST_BYTES, HARD_BYTES, MOST_S, HARD_S, WALL_S = 2**30, 3 * 2**30, 10.0, 20, 180.0
HEADER = "command,format,cases,exit_0,exit_1,violations,most_mb,longest_s"
NO_EVENTS = ("folder", "numbered", ".avi", ".png")
REFUSED = {f"estimate {kind}" for kind in NO_EVENTS}  # of sound files: no other command may refuse one


class Answer(NamedTuple):
    """Exit code (negative: a signal), lines on stderr, memory above the idle process, processor time."""

    code: int
    err: str
    bytes: int
    seconds: float

    @property
    def violation(self) -> str:
        """What is wrong with the answer, or nothing."""
        if self.code not in (0, 1):
            return f"ended by {self.code}: " + "".join(self.err.strip().splitlines()[-1:])
        if "Traceback" in self.err:
            return "traceback: " + self.err.strip().splitlines()[-1]
        if len(self.err.splitlines()) > 2:
            return f"{len(self.err.splitlines())} lines"
        if self.bytes > MOST_BYTES:
            return f"{self.bytes / 2**20:.0f} MB"
        return f"{self.seconds:.1f} s" if self.seconds > MOST_S else ""


def resident_bytes() -> int:
    """Memory of this process that is in use now."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def answer(argv: list[str]) -> Answer:
    """Run ``lmmap`` in a forked process under limits."""
    sys.stdout.flush()
    with tempfile.TemporaryFile() as err:
        read_end, write_end = os.pipe()
        child = os.fork()
        if not child:
            code = 99
            try:
                os.write(write_end, resident_bytes().to_bytes(8, "big"))  # a child holds part of its parent's
                os.setsid()
                silent = os.open(os.devnull, os.O_RDWR)
                for stream, target in ((0, silent), (1, silent), (2, err.fileno())):
                    os.dup2(target, stream)
                size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
                resource.setrlimit(resource.RLIMIT_AS, (size + HARD_BYTES, size + HARD_BYTES))
                resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
                resource.setrlimit(resource.RLIMIT_CPU, (HARD_S, HARD_S))
                code = command.main(argv)
            except SystemExit as stop:
                code = stop.code if isinstance(stop.code, int) else 1
            except BaseException:
                import traceback

                traceback.print_exc()
            finally:
                sys.stderr.flush()
                os._exit(code)
        ended = os.pidfd_open(child)
        poll = select.poll()
        poll.register(ended, select.POLLIN)
        over = False
        try:
            over = bool(poll.poll(WALL_S * 1000))
        finally:
            if not over:
                os.killpg(child, signal.SIGKILL)
            os.close(ended)
        _, status, used = os.wait4(child, 0)
        idle = int.from_bytes(os.read(read_end, 8), "big")
        os.close(read_end), os.close(write_end)
        err.seek(0)
        text = err.read().decode(errors="replace")
    bytes_above = max(0, used.ru_maxrss * 1024 - idle)
    return Answer(os.waitstatus_to_exitcode(status), text, bytes_above, used.ru_utime + used.ru_stime)


def attack(
    count: int,
    seed: int,
    report=print,
    directed: bool = True,
    formats: tuple[str, ...] = (),
    only: tuple[str, ...] = (),
    keep: Path | None = None,
) -> list[tuple[Case, Answer]]:
    """Run so many cases; each with its answer.  The files of violations are kept in a folder ``keep``."""
    answered = []
    with suppress(KeyboardInterrupt), tempfile.TemporaryDirectory() as folder:  # what was answered is printed
        for case in cases(count, seed, Path(folder), directed, formats, only):
            result = answer(case.argv)
            answered.append((case, result))
            if result.violation:
                report(
                    f"VIOLATION {case.command} {case.format} [{case.attack}]: {result.violation}", flush=True
                )
                if keep and not case.attack.startswith("directed"):
                    shutil.copytree(Path(folder) / "mutated", keep / str(len(answered)))
                    (keep / str(len(answered)) / "argv").write_text("\n".join((*case.argv, result.err)))
    return answered


def changed_inputs(folder: Path) -> list[tuple[list[str], str]]:
    """Run every command on recordings, and estimate from every format; arguments and problem of each bad
    answer, which a refusal is too.  Prints the commands."""
    inputs = folder / "inputs"
    inputs.mkdir()
    (folder / "drawn").mkdir()
    sound = every_sound_file(inputs, np.random.default_rng(0))
    poses, modality = str(folder / "poses.csv"), ("--modality", "event")
    todo = {"info": ["info", str(sound[".h5"])]}
    for kind, path in sound.items():  # each format once, each command once
        every = commands(path, kind, folder, sound)
        for name, argv in every.items():
            is_own = name == "estimate" or len(every) <= 3  # of what is no recording, all
            todo.setdefault(f"{name} {kind}" if is_own else name, argv)
    todo |= {
        "poses": ["estimate", str(sound[".h5"]), *modality, "--events", "500", "-o", poses],
        "draw": ["draw", str(sound[".h5"]), poses, *modality, "--events", "500", "-o", f"{folder}/v.avi"],
        "pictures": ["pictures", str(sound["numbered"]), "--modality", "rgb", "-o", f"{folder}/drawn"],
    }
    before, wrong = digests(inputs), []
    for name, argv in todo.items():
        result = answer(argv)
        refused = result.code and name not in REFUSED and f"refused: {result.err}"
        problem = result.violation or refused or (digests(inputs) != before and "an input changed")
        wrong += [(argv, problem)] if problem else []
    print(*sorted({argv[0] for argv in todo.values()}))
    return wrong


def digests(folder: Path) -> dict[str, str]:
    """Hashes of all files below a folder, by their names in it."""
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def print_table(answered: list[tuple[Case, Answer]]) -> None:
    """Cases, exits, violations, most memory and longest time of each command and format, and of all."""
    groups = collections.defaultdict(list)
    for case, result in answered:
        for row in ((case.command, case.format), (case.command, ""), ("all", "")):
            groups[row].append(result)
    print(HEADER)
    for row in sorted(groups):
        results = groups[row]
        codes = [None if r.violation else r.code for r in results]
        most_mb = max(r.bytes for r in results) / 2**20
        print(*row, len(codes), *map(codes.count, (0, 1, None)), f"{most_mb:.0f}",
              f"{max(r.seconds for r in results):.1f}", sep=",")  # fmt: skip


def sum_tables(paths: list[Path]) -> pd.DataFrame:
    """The table of several runs together, such as of several seeds at once, from what each printed."""
    texts = [HEADER + path.read_text().partition(HEADER)[2].partition("{")[0] for path in paths]
    tables = pd.concat(pd.read_csv(io.StringIO(text)) for text in texts)
    how = dict.fromkeys(("cases", "exit_0", "exit_1", "violations"), "sum")
    how |= dict.fromkeys(("most_mb", "longest_s"), "max")
    return tables.fillna({"format": ""}).groupby(["command", "format"]).agg(how).reset_index()


def warm_up() -> None:
    """Import what commands import when they run, and load the shipped networks, so that a forked process
    need not."""
    import lmmap_lab.cli.authors
    import lmmap_lab.studies.odometry_files  # noqa: F401
    from lmmap.pipeline import image_estimator

    image_estimator.load_networks = functools.cache(image_estimator.load_networks)
    for modality in ("rgb", "event"):
        for gap in ("low", "robust"):
            image_estimator.load_networks(gap, modality, "auto")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("count", type=int, nargs="?", default=10_000)
    parser.add_argument("seed", type=int, nargs="?", default=0)
    parser.add_argument("--mutations-only", action="store_true", help="without the directed attacks")
    parser.add_argument("--formats", default="", help="mutate only these, such as .bag,CD.h5")
    parser.add_argument("--only", default="", help="run only these commands, such as calibrate,score")
    parser.add_argument("--keep", type=Path, help="a folder for the files whose answers are violations")
    parser.add_argument("--sum", type=Path, nargs="+", help="what runs printed: print their sum instead")
    parser.add_argument("--sound-in", type=Path, help="run each command on sound files here instead")
    arguments = parser.parse_args()
    if arguments.sum:
        sys.exit(print(sum_tables(arguments.sum).to_csv(index=False), end=""))
    began = time.monotonic()
    warm_up()
    if arguments.sound_in:
        problems = changed_inputs(arguments.sound_in)
        print(*problems, sep="\n", end="", file=sys.stderr)
        sys.exit(bool(problems))
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # the table is printed then too
    formats, only = (tuple(filter(None, a.split(","))) for a in (arguments.formats, arguments.only))
    answered = attack(
        arguments.count,
        arguments.seed,
        directed=not arguments.mutations_only,
        formats=formats,
        only=only,
        keep=arguments.keep,
    )
    wrong = sum(bool(result.violation) for _, result in answered)
    print_table(answered)
    print(json.dumps({"minutes": round((time.monotonic() - began) / 60, 1), "violations": wrong}))
    sys.exit(bool(wrong))
