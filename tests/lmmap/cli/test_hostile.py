"""Commands lose nothing: outputs that are not theirs stay, inputs never change, and answers are short."""

import hashlib
import json
import os
import subprocess
import sys
from functools import partial
from pathlib import Path

import attack_recordings as attacks
import attack_sound
import numpy as np
import pytest
import torch
from attack_sound import CAMERA
from library_files import write_recording
from test_accuracy_run import made_up
from test_train import toy  # noqa: F401

from lmmap.cli import main
from lmmap.cli.arguments import parser
from lmmap.files import InputError, lock
from lmmap.recordings.journal import Journal
from lmmap_lab.bench import photometry
from lmmap_lab.cli import bench
from lmmap_lab.provenance import DATA, ROOT
from lmmap_lab.studies import accuracy_run
from lmmap_lab.studies.bag_estimates import resumable_file
from lmmap_lab.training import train

MINI = DATA / "mini" / "test-low.aedat4"
NOTES = "notes that nobody has a copy of\nand a second line"


@pytest.fixture
def lmmap(capsys):
    """Run a command; its exit code and what it printed."""

    def run(*argv):
        code = main.main([str(a) for a in argv])
        out, err = capsys.readouterr()
        return code, out, err

    return run


def estimate(output, *extra, recording=MINI):
    return ("estimate", recording, "--modality", "rgb", "--rate", "5", "-o", output, *extra)


@pytest.mark.parametrize("extra", [(), ("--resume",), ("--resume", "--format", "tum")])
def test_a_file_that_is_not_ours_is_not_touched(tmp_path, lmmap, extra):
    path = tmp_path / "poses.csv"
    path.write_text(NOTES)
    code, _, err = lmmap(*estimate(path, *extra))
    assert code == 1 and len(err.splitlines()) == 1 and path.read_text() == NOTES
    assert [p.name for p in tmp_path.iterdir()] == ["poses.csv"]


@pytest.mark.parametrize("flag", ["--overwrite", "--resume"])
def test_no_output_replaces_an_input(tmp_path, lmmap, flag):
    for source in (MINI, MINI.with_suffix(".camera.json"), MINI.with_suffix(".truth.csv")):
        (tmp_path / source.name).write_bytes(source.read_bytes())
    before = attacks.digests(tmp_path)
    recording = tmp_path / MINI.name
    (tmp_path / "link.csv").symlink_to(recording)
    for output in (
        recording,
        recording.with_suffix(".camera.json"),
        recording.with_suffix(".truth.csv"),
        tmp_path / "link.csv",
    ):
        code, _, err = lmmap(*estimate(output, flag, recording=recording))
        assert code == 1 and "is also read as" in err
    assert {k: v for k, v in attacks.digests(tmp_path).items() if k != "link.csv"} == before


def test_an_output_that_exists_needs_a_word(tmp_path, lmmap):
    path = tmp_path / "poses.csv"
    assert lmmap(*estimate(path))[0] == 0
    before = attacks.digests(tmp_path)
    code, _, err = lmmap(*estimate(path))
    assert code == 1 and "--overwrite" in err and attacks.digests(tmp_path) == before
    assert lmmap(*estimate(path, "--resume"))[0] == 0 and attacks.digests(tmp_path) == before
    code, _, err = lmmap(*estimate(path, "--resume", "--events", "500"))
    assert code == 1 and "settings" in err and attacks.digests(tmp_path) == before
    assert lmmap(*estimate(path, "--overwrite"))[0] == 0 and attacks.digests(tmp_path) == before


def test_two_processes_on_one_output(tmp_path):
    path = tmp_path / "poses.csv"
    code = (
        "import sys; from lmmap.files import InputError, lock\n"
        "try:\n    with lock(sys.argv[1]): print('free')\nexcept InputError as error: print(error)"
    )
    with Journal(path):
        held = subprocess.run(
            [sys.executable, "-c", code, path], capture_output=True, text=True, cwd=ROOT
        ).stdout
        with pytest.raises(InputError, match="another process"), lock(path):
            pass
    free = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True, cwd=ROOT).stdout
    assert "another process writes" in held and free == "free\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "argv",
    [
        ("info", MINI, "--camera", "{}.json"),
        ("info", MINI, "--camera", "{}.yaml"),
        ("estimate", MINI, "--modality", "rgb", "--port", "{}.json", "-o", "{}.out.csv"),
        ("evaluate", MINI, "--truth", "{}.csv"),
        ("odometry", "score", "{}.tum", "--reference", MINI.with_suffix(".truth.csv")),
        ("odometry", "score", MINI.with_suffix(".truth.csv"), "--reference", "{}.tum"),
        ("draw", MINI, "{}.csv", "--modality", "rgb", "-o", "{}.out.webm"),
    ],
    ids=lambda argv: " ".join(str(a) for a in argv[:1] + argv[2:4]),
)
def test_what_never_ends_is_not_read(tmp_path, lmmap, argv):
    """Pipes and devices in the place of every other file that a command reads."""
    for kind in ("pipe", "device"):
        for suffix in (".json", ".yaml", ".csv", ".tum"):
            path = tmp_path / f"{kind}{suffix}"
            os.mkfifo(path) if kind == "pipe" else path.symlink_to("/dev/zero")
        code, _, err = lmmap(*(str(a).replace("{}", str(tmp_path / kind)) for a in argv))
        assert code == 1 and len(err.splitlines()) == 1 and "a device or a pipe" in err, err


def test_names_that_are_not_utf8(tmp_path, lmmap):
    name = os.fsdecode(os.fsencode(tmp_path) + b"/poses-\xff.csv")
    run = subprocess.run(
        [sys.executable, "-m", "lmmap", *map(str, estimate(name))], capture_output=True, cwd=ROOT
    )
    assert run.returncode == 0 and b"Traceback" not in run.stderr and Path(name).exists()
    run = subprocess.run([sys.executable, "-m", "lmmap", "info", name], capture_output=True, cwd=ROOT)
    assert run.returncode == 1 and len(run.stderr.splitlines()) == 1


def test_a_jump_of_hours_at_a_rate_ends_in_seconds(tmp_path, lmmap):
    lines = [f"{50 * k + (7_200_000_000 if k > 9000 else 0)} {k % 64} 5 1\n" for k in range(18_000)]
    (tmp_path / "gap.txt").write_text("".join(lines))
    CAMERA.save(tmp_path / "camera.json")
    code, out, err = lmmap(
        "estimate",
        tmp_path / "gap.txt",
        "--camera",
        tmp_path / "camera.json",
        "--modality",
        "event",
        "--events",
        "500",
        "--rate",
        "100",
        "-o",
        tmp_path / "p.csv",
        "--json",
    )
    assert code == 0 and "no events for 7200 s" in err and len(err.splitlines()) == 1
    assert json.loads(out)["images"] < 120


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


STUDIES = {
    "simulate": (
        "--sequence",
        "realistic-7",
        "--seconds",
        "0.2",
        "--camera",
        "{}/camera.json",
        "-o",
        "{}/s.h5",
    ),
    "photometry": ("-o", "{}/lamps.json"),
    "train": ("--filter", "ring", "--modality", "event", "--domain-gap", "low", "--steps", "1"),
    "reproduce": ("--profile", "quick"),
    "check": (),
    "completion": ("bash",),
}


@pytest.mark.parametrize("name", STUDIES)
def test_studies_change_no_file_that_they_were_not_told_to_write(name, tmp_path, monkeypatch, lmmap, request):
    """On toy training sets and made-up estimates: hashes of the whole project before and after."""
    CAMERA.save(tmp_path / "camera.json")
    monkeypatch.setattr(bench, "DERIVED_DATA", tmp_path)
    monkeypatch.setattr(photometry, "calibrate_lamps", lambda _: {"gain": 1.0})
    if name == "reproduce":
        study = partial(accuracy_run.reproduce, study=made_up(tmp_path))
        monkeypatch.setattr(accuracy_run, "reproduce", study)
    if name == "train":
        samples = request.getfixturevalue("toy").glob("augmented-*")
        (tmp_path / "training").mkdir()
        for folder in samples:
            folder.rename(tmp_path / "training" / folder.name)
        blank = torch.zeros(1, 1, 32, 32)
        monkeypatch.setattr(train, "make_batch", lambda *_: (blank, blank))
    files = subprocess.run(["git", "ls-files", "-z"], capture_output=True, cwd=ROOT, text=True).stdout
    files = [ROOT / name for name in files.split("\0") if name and (ROOT / name).is_file()]
    before, inputs = hashes(files), attacks.digests(tmp_path)
    code, _, err = lmmap(name, *(a.format(tmp_path) for a in STUDIES[name]))
    assert code == 0 or (name == "check" and len(err.splitlines()) == 1), err
    assert hashes(files) == before
    assert inputs.items() <= attacks.digests(tmp_path).items()


def hashes(files) -> list[str]:
    return [hashlib.sha256(path.read_bytes()).hexdigest() for path in files]


def test_estimates_of_a_bag_replace_no_other_file(tmp_path):
    """``lmmap calibrate`` keeps them beside its output, under a name that somebody may have used."""
    path = tmp_path / "rig.normal__train-rgb.csv"
    path.write_text(NOTES)
    with pytest.raises(InputError, match="not ours to replace"):
        resumable_file(path, MINI, 5.0)
    assert path.read_text() == NOTES


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


@pytest.mark.parametrize(
    "argv, name",
    [
        (("simulate", "--sequence", "realistic-7", "--seconds", "0.2", "--camera", "{}/camera.json"), "r.h5"),
        (
            ("simulate", "--sequence", "realistic-7", "--seconds", "0.2", "--camera", "{}/camera.json"),
            "r.bag",
        ),
        (("estimate", "{}/r.h5", "--modality", "rgb"), "poses.csv"),
    ],
)
def test_a_full_disk_leaves_the_old_output_whole(tmp_path, argv, name):
    """A limit on the size of files stands for the disk."""
    write_recording(attack_sound.recording(np.random.default_rng(0)), tmp_path / "r.h5")
    CAMERA.save(tmp_path / "camera.json")
    output = tmp_path / name
    if not output.exists():
        output.write_text(NOTES)
    before = attacks.digests(tmp_path)
    arguments = [a.format(tmp_path) for a in argv]
    run = subprocess.run(
        [sys.executable, "-c", LIMITED, *arguments, "-o", output, "--overwrite"],
        capture_output=True, text=True, cwd=ROOT,
    )  # fmt: skip
    assert run.returncode == 1 and len(run.stderr.splitlines()) == 1 and name in run.stderr, run.stderr
    assert before.items() <= attacks.digests(tmp_path).items()


CACHELESS = """
import sys, tempfile
def refuse(*_, **__): raise PermissionError(13, "Permission denied")
tempfile.TemporaryFile = refuse  # by which numba finds out where it may write
from lmmap.cli import main
sys.exit(main.main(sys.argv[1:]))
"""


@pytest.mark.parametrize(
    "extra", [("--track", "--modality", "rgb"), ("--modality", "event", "--events", "500")]
)
def test_a_home_that_is_read_only_costs_caches_and_no_answer(tmp_path, extra):
    write_recording(attack_sound.recording(np.random.default_rng(0)), tmp_path / "r.h5")
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
