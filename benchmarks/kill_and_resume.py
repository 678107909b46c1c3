"""Kill commands with SIGKILL at random moments and start them again, until they end by themselves.

    python benchmarks/kill_and_resume.py [ROUNDS] [SEED] [--reproduce]

Each round compares every byte of what a command leaves with that of an unbroken run, but for checkpoints,
whose header has no order.  The training has small made-up images, the study made-up estimates.
``--reproduce`` adds the results of the short profile, minutes a round, in ``data/derived`` of this checkout.
Prints a line a command, and ends with 1 if an output differs or a run leaves parts behind.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from attack_recordings import digests

from lmmap_lab.provenance import DATA, DERIVED_DATA, ROOT

MINI = DATA / "mini" / "test-low.aedat4"
SHORTEST_S = 0.3
STUDY = f"""
import sys
from pathlib import Path
sys.path[:0] = [{str(ROOT / "tests")!r}, {str(ROOT / "tests" / "studies")!r}]
from test_accuracy_run import accuracy_run, made_up
accuracy_run.reproduce("quick", print, study=made_up(Path(sys.argv[1])))
"""


def commands(reproduce: bool) -> dict[str, tuple[list[str], str]]:
    """Python's arguments of each command, ``{}`` standing for its folder, and the one that makes it go on."""
    lmmap, mini = ["-m", "lmmap"], str(MINI)
    out = {
        "estimate": ([*lmmap, "estimate", mini, "--modality", "rgb", "-o", "{}/poses.csv"], "--resume"),
        "estimate to TUM": ([*lmmap, "estimate", mini, "--modality", "event", "-o", "{}/p.tum"], "--resume"),
        "simulate": (
            [*lmmap, "simulate", "--sequence", "realistic-7", "--seconds", "2", "-o", "{}/r.h5"],
            "",
        ),
        "train": ([str(ROOT / "benchmarks" / "toy_training.py"), "{}"], ""),
        "study": (["-c", STUDY, "{}"], ""),
    }
    return out | ({"reproduce": ([*lmmap, "reproduce", "--profile", "quick"], "")} if reproduce else {})


def run(argv: list[str], seconds: float | None = None) -> float | None:
    """Seconds that a command took to end; None if it was killed after ``seconds``."""
    began = time.monotonic()
    child = subprocess.Popen([sys.executable, *argv], stdout=-3, stderr=subprocess.PIPE)
    try:
        _, err = child.communicate(timeout=seconds)
    except subprocess.TimeoutExpired:
        child.kill()
        child.communicate()
        return None
    if child.returncode:
        raise SystemExit(f"{' '.join(argv)}: exit {child.returncode}: {err.decode()}")
    return time.monotonic() - began


def kills(argv: list[str], resume: str, whole_s: float, rng) -> int:
    """Run until it ends by itself; how often it was killed."""
    count = 0
    while run(argv + ([resume] if count and resume else []), SHORTEST_S + whole_s * rng.random()) is None:
        count += 1
    return count


def check(name: str, argv: list[str], resume: str, rounds: int, rng) -> bool:
    """Print how often a command was killed, and whether it left what an unbroken run leaves."""
    with tempfile.TemporaryDirectory() as scratch:
        unbroken = Path(scratch) / "unbroken"
        unbroken.mkdir()
        seconds = run([a.replace("{}", str(unbroken)) for a in argv])
        expected, total, same = _left(name, unbroken), 0, True
        for k in range(rounds):
            folder = Path(scratch) / f"{k}"
            folder.mkdir()
            if name == "reproduce":
                shutil.rmtree(DERIVED_DATA / "quick")
            total += kills([a.replace("{}", str(folder)) for a in argv], resume, seconds, rng)
            left = _left(name, folder)
            if differing := sorted(k for k in {*left, *expected} if left.get(k) != expected.get(k)):
                print(f"{name}: {', '.join(differing)}", flush=True)
            same &= left == expected
        print(
            f"{name:16} {seconds:6.1f} s unbroken, {total:3d} kills, {'equal' if same else 'DIFFERENT'}",
            flush=True,
        )
        return same


def _left(name: str, folder: Path) -> dict[str, str]:
    """Hashes of what a command left, by names."""
    left = digests(DERIVED_DATA / "quick" if name == "reproduce" else folder)
    return {name: digest for name, digest in left.items() if ".ckpt." not in name}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("rounds", type=int, nargs="?", default=5)
    parser.add_argument("seed", type=int, nargs="?", default=0)
    parser.add_argument("--only", nargs="+", default=[], metavar="NAME", help="such as train study")
    parser.add_argument("--reproduce", action="store_true", help="also the results of the short profile")
    a = parser.parse_args()
    rng = np.random.default_rng(a.seed)
    chosen = {name: what for name, what in commands(a.reproduce).items() if not a.only or name in a.only}
    checks = [check(name, *what, a.rounds, rng) for name, what in chosen.items()]
    sys.exit(not all(checks))
