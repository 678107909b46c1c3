"""Commands in processes of their own: interrupted, on a full disk, without caches, over many images."""

import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import drawn
import pytest
from library_files import write_recording

from lmmap.shipped import ROOT

DRAWN = drawn.file()
NOTES = "notes that nobody has a copy of\nand a second line"


def estimate(output, *extra):
    return ("estimate", DRAWN, "--modality", "rgb", "--rate", "5", "-o", output, *extra)


def test_names_that_are_not_utf8(tmp_path):
    name = os.fsdecode(os.fsencode(tmp_path) + b"/poses-\xff.csv")
    run = subprocess.run([sys.executable, "-m", "lmmap", *estimate(name)], capture_output=True, cwd=ROOT)
    assert run.returncode == 0 and b"Traceback" not in run.stderr and Path(name).exists()
    run = subprocess.run([sys.executable, "-m", "lmmap", "info", name], capture_output=True, cwd=ROOT)
    assert run.returncode == 1 and len(run.stderr.splitlines()) == 1


def test_disk_full_in_the_middle_keeps_what_was_estimated(tmp_path):
    """A limit on the size of files stands for the disk; the lines before it are whole."""
    poses = tmp_path / "poses.csv"
    run = subprocess.run(
        [sys.executable, "-m", "lmmap", "estimate", DRAWN, "--modality", "event", "-o", poses],
        capture_output=True, text=True, cwd=ROOT, preexec_fn=lambda: resource.setrlimit(
            resource.RLIMIT_FSIZE, (6000, 6000)),
    )  # fmt: skip
    assert run.returncode == 1 and "--resume" in run.stderr and "Traceback" not in run.stderr
    assert len(run.stderr.splitlines()) == 1 and poses.stat().st_size <= 6000
    assert len(poses.read_text().splitlines()) > 2


def test_interrupted(tmp_path):
    """Ctrl-C in the middle: exit code 130, whole lines on disk, no traceback."""
    poses = tmp_path / "poses.csv"
    run = subprocess.Popen(
        [sys.executable, "-m", "lmmap", "estimate", DRAWN, "--modality", "event", "-o", poses],
        stderr=subprocess.PIPE, text=True, cwd=ROOT,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # jobs in the background ignore it
    )  # fmt: skip
    for _ in range(1200):
        if poses.exists() and poses.read_bytes().count(b"\n") > 2:
            break
        time.sleep(0.05)
    run.send_signal(signal.SIGINT)
    _, err = run.communicate()
    assert run.returncode == 130 and "keeps what was estimated" in err and "Traceback" not in err
    content = poses.read_bytes()
    assert content.endswith(b"\n") and 2 < content.count(b"\n") < 12


LIMITED = """
import resource, sys
from lmmap.cli import main
resource.setrlimit(resource.RLIMIT_FSIZE, (400, 400))
sys.exit(main.main(sys.argv[1:]))
"""


def test_a_full_disk_leaves_the_old_output_whole(tmp_path):
    """A limit on the size of files stands for the disk."""
    output = tmp_path / "poses.csv"
    output.write_text(NOTES)
    run = subprocess.run(
        [sys.executable, "-c", LIMITED, *estimate(output, "--overwrite")],
        capture_output=True, text=True, cwd=ROOT,
    )  # fmt: skip
    assert run.returncode == 1 and len(run.stderr.splitlines()) == 1 and "poses.csv" in run.stderr, run.stderr
    assert output.read_text() == NOTES


CACHELESS = """
import sys, tempfile
def refuse(*_, **__): raise PermissionError(13, "Permission denied")
tempfile.TemporaryFile = refuse  # by which numba finds out where it may write
from lmmap.cli import main
sys.exit(main.main(sys.argv[1:]))
"""


@pytest.mark.parametrize(
    "extra", [("--track", "--modality", "rgb"), ("--modality", "event", "--events", "5000")]
)
def test_a_home_that_is_read_only_costs_caches_and_no_answer(tmp_path, extra):
    write_recording(drawn.recording(3), tmp_path / "r.h5")
    run = subprocess.run(
        [sys.executable, "-c", CACHELESS, "estimate", tmp_path / "r.h5", *extra, "-o", tmp_path / "p.csv"],
        capture_output=True, text=True, cwd=ROOT,
        env={**os.environ, "HOME": "/proc", "XDG_CACHE_HOME": "/proc", "MPLCONFIGDIR": "/proc/none"},
    )  # fmt: skip
    assert run.returncode == 0 and len(run.stderr.splitlines()) <= 2, run.stderr
    assert len((tmp_path / "p.csv").read_text().splitlines()) > 2


def test_images_cost_no_memory_and_no_open_files():
    """Few here; thousands by ``benchmarks/steady_memory.py`` alone."""
    script = ROOT / "benchmarks" / "steady_memory.py"
    run = subprocess.run([sys.executable, script, "120"], capture_output=True, text=True, timeout=400)
    assert run.returncode == 0, run.stdout + run.stderr
