"""The attack suite and a full disk, in processes of their own: they fork, limit themselves, and can hang."""

import json
import subprocess
import sys

import attack_recordings as attacks
import attack_sound
import numpy as np
import pytest
from attack_sound import CAMERA
from test_files_stay import NOTES, STUDIES

from lmmap.cli.arguments import parser
from lmmap_lab.bench.writers import write_recording
from lmmap_lab.provenance import ROOT


def suite(*arguments) -> subprocess.CompletedProcess:
    """The attack suite in a process of its own: it forks, and this process has threads."""
    script = ROOT / "benchmarks" / "attack_recordings.py"
    command = [sys.executable, script, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=400)


def test_commands_change_no_file_that_they_were_not_told_to_write(tmp_path):
    """Every command on sound files: hashes of all inputs before and after."""
    done = suite("--sound-in", tmp_path)
    assert done.returncode == 0 and not done.stderr, done.stdout + done.stderr
    (commands,) = (a.choices for a in parser()._subparsers._group_actions)
    assert set(done.stdout.splitlines()[-1].split()) | {*STUDIES} == {*commands}


def test_damaged_and_hostile_files_get_short_answers():
    """Sixty cases of the attack suite, mutations only: directed ones have tests of their own."""
    done = suite(60, 1, "--mutations-only")
    assert done.returncode == 0, done.stdout + done.stderr
    assert json.loads(done.stdout.splitlines()[-1])["violations"] == 0


LIMITED = """
import resource, sys
from lmmap.cli import main
resource.setrlimit(resource.RLIMIT_FSIZE, (400, 400))
sys.exit(main.main(sys.argv[1:]))
"""


@pytest.mark.parametrize("name", ["r.h5", "r.bag"])
def test_a_full_disk_leaves_the_old_recording_whole(tmp_path, name):
    """A limit on the size of files stands for the disk."""
    write_recording(attack_sound.recording(np.random.default_rng(0)), tmp_path / "r.h5")
    CAMERA.save(tmp_path / "camera.json")
    if not (tmp_path / name).exists():
        (tmp_path / name).write_text(NOTES)
    before = attacks.digests(tmp_path)
    argv = ["simulate", "--sequence", "realistic-7", "--seconds", "0.2", "--camera", tmp_path / "camera.json"]
    run = subprocess.run(
        [sys.executable, "-c", LIMITED, *argv, "-o", tmp_path / name, "--overwrite"],
        capture_output=True, text=True, cwd=ROOT,
    )  # fmt: skip
    assert run.returncode == 1 and len(run.stderr.splitlines()) == 1 and name in run.stderr, run.stderr
    assert before.items() <= attacks.digests(tmp_path).items()
