"""A sample of the attack suite, in a process of its own: it forks, and this process has threads."""

import subprocess
import sys

from lmmap_lab.provenance import ROOT

COUNT, SEED = 150, 1


def test_a_sample_of_attacks_finds_no_fault():
    """Each command on sound files, and attacks of every kind."""
    command = [sys.executable, ROOT / "benchmarks" / "attack.py", "--count", str(COUNT), "--seed", str(SEED)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0 and not done.stderr, done.stdout + done.stderr
    assert done.stdout.startswith(f"{COUNT} attacks, 0 faults")
