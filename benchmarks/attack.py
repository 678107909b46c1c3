"""Attack every command and argument that the parser lists, and count the answers by kind.

    python benchmarks/attack.py [--count N] [--seed S] [--only KINDS] [--commands NAMES] [--table FILE]

Each attack is a command in a folder of its own with sound files of every format.  It runs in a process that
is forked from one that has imported everything, under limits of memory and time.  What has to be true is in
`attack_checks`: one line on stderr and exit 0, 1 or 2; nothing of the user's is changed; a refusal names what
it refuses; what is asked for is looked at; a command that was killed ends as one that was not.  Prints each
fault, and ends with 1 if there is one.
"""

from __future__ import annotations

import os

# before torch is imported: a forked process would wait for ever for its parent's threads
os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["OPENCV_LOG_LEVEL"] = "SILENT"  # as the command sets it, before OpenCV is imported

import argparse
import functools
import gc
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path

sys.path.extend(str(Path(__file__).parents[1] / "tests" / part) for part in ("", "lmmap", "lab/studies"))

import attack_calls
import attack_kinds
import attack_rig
import numpy as np
import onnx  # noqa: F401  a child that may read nothing here could not load it
import pandas as pd
from attack_checks import snapshot
from attack_directed import directed_files

from lmmap.cli.choices import MODALITIES, SETS
from lmmap_lab.provenance import save_table

LIGHTER = dict.fromkeys(SETS, "slim")
COLUMNS = ["kind", "command", "attacks", "done", "refused", "usage", "faults", "most_mb", "longest_s"]


def warm_up() -> None:
    """Import everything that commands import lazily and load the lightest networks in place of every set, so
    that forked processes need not."""
    import lmmap_lab.cli.authors
    import lmmap_lab.studies.odometry_files  # noqa: F401
    from lmmap.pipeline import image_estimator

    load = functools.cache(image_estimator.load_networks)
    image_estimator.load_networks = lambda weights, *facts: load(LIGHTER.get(str(weights), weights), *facts)
    for modality in MODALITIES:
        load("slim", modality, "auto")


def attacked(count: int, seed: int, kinds=(), commands=()) -> Iterator[tuple]:
    """Yield each attack with the command's answer and its fault, if any."""
    warm_up()
    attack_calls.stub()
    rng = np.random.default_rng(seed)
    calls = [c for c in attack_calls.calls() if not commands or c.name in commands]
    attacks = attack_kinds.attacks(calls, rng, kinds)
    with tempfile.TemporaryDirectory() as scratch:
        os.chmod(scratch, 0o755)
        sound, folder, directed = (Path(scratch, name) for name in ("sound", "attacked", "directed"))
        sound.mkdir(), directed.mkdir()
        sound.with_name("temporary").mkdir(0o777)
        attack_kinds.DIRECTED |= directed_files(directed)
        attack_rig.write(sound, rng)
        gc.freeze()
        spare, as_made = shutil.copytree(sound, Path(scratch, "spare")), snapshot(sound)
        for attack in islice(attacks, count):
            shutil.copytree(sound, folder, copy_function=os.link)
            yield attack, *attack_kinds.run(attack, folder, rng)
            shutil.rmtree(folder)
            if snapshot(sound) != as_made:  # a command was told to write into one of its files
                shutil.rmtree(sound)
                as_made = snapshot(shutil.copytree(spare, sound))


def table(answered: list[tuple]) -> pd.DataFrame:
    """Number of attacks, exit codes and faults, peak memory and longest time by kind and command."""
    rows = [
        (t.kind, t.call.name, 1, *(a.code == k for k in range(3)), bool(fault), a.bytes / 2**20, a.seconds)
        for t, a, fault in answered
    ]
    groups = pd.DataFrame(rows, columns=COLUMNS).groupby(COLUMNS[:2], sort=True)
    how = dict.fromkeys(COLUMNS[2:7], "sum") | dict.fromkeys(COLUMNS[7:], "max")
    return groups.agg(how).reset_index().round({"most_mb": 0, "longest_s": 1}).astype({"most_mb": int})


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="kinds of attack, such as killed,value")
    parser.add_argument("--commands", default="", help="such as 'estimate,odometry score'")
    parser.add_argument("--table", type=Path, help="CSV to write, with its provenance beside it")
    a = parser.parse_args()
    kinds, commands = (tuple(filter(None, text.split(","))) for text in (a.only, a.commands))
    answered, began = [], time.monotonic()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with suppress(KeyboardInterrupt):  # the table is then of what was answered
        for attack, given, fault in attacked(a.count, a.seed, kinds, commands):
            answered.append((attack, given, fault))
            if fault:
                print(f"FAULT {len(answered)} {attack}: {fault}", flush=True)
    rows = table(answered)
    faults = int(rows.faults.sum())
    print(f"{len(answered)} attacks, {faults} faults, {(time.monotonic() - began) / 60:.1f} min")
    if a.table:
        save_table(a.table, rows, command=f"benchmarks/attack.py --count {len(answered)} --seed {a.seed}")
    sys.exit(bool(faults))
