"""Commands and truths of other packages: found where they are installed, and one line where they are not."""

import json
import subprocess
import sys
from dataclasses import replace

import drawn
import pytest
from library_files import write_recording

from lmmap import plugins
from lmmap.cli import main
from lmmap.shipped import ROOT
from lmmap.types import Pose
from lmmap_readers.rig import RIG_FILE, Rig

WORDS = """
def greet(commands):
    command = commands.add("greet", "other_words:hello", "say hello")
    command.add_argument("--name")
    commands.add("lack", "other_words:lack", "need what is not there")
    commands.add("err", "other_words:err", "import what we never wrote")

def hello(a):
    print("hello", a.name)

def lack(a):
    import absent_package

def err(a):
    import lmmap.absent

def learned(a):
    import shutil
    from lmmap.pipeline.weights import network_paths
    folder = a.output.with_suffix(f".{a.adapt:g}s")
    folder.mkdir()
    for path in network_paths("low", a.modality):
        shutil.copy(path, folder)
        shutil.copy(path.with_suffix(".json"), folder)
    return folder
"""
ENTRIES = """[console_scripts]
greet = elsewhere:main

[lmmap.commands]
greet = other_words:greet
info = other_words:greet
mute = absent_words:mute
old = other_words:former

[lmmap.truths]
still = other_words:still
"""


@pytest.fixture
def other(tmp_path, monkeypatch):
    """A package that is installed beside ours."""
    (tmp_path / "other_words.py").write_text(WORDS)
    (tmp_path / "other-1.0.dist-info").mkdir()
    (tmp_path / "other-1.0.dist-info" / "entry_points.txt").write_text(ENTRIES)
    (tmp_path / "other-1.0.dist-info" / "METADATA").write_text("Name: other\nVersion: 1.0\n")
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    sys.modules.pop("other_words", None)


def test_a_command_of_another_package_is_a_command(other, capsys):
    assert main.main(["greet", "--name", "you"]) == 0
    assert capsys.readouterr().out == "hello you\n"
    with pytest.raises(SystemExit):
        main.main(["--help"])
    ours, theirs = capsys.readouterr().out.split("\ncommands of the laboratory")
    assert "  estimate " in ours and "greet" not in ours and "  greet " in theirs and "say hello" in theirs
    assert "  info " in ours and "  info " not in theirs
    assert main.main(["completion", "bash"]) == 0 and "greet" in capsys.readouterr().out


@pytest.mark.parametrize("line", ["mute", "mute --loud -o x.csv y", "mute --help", "lack", "old -x"])
def test_what_is_not_installed_is_one_line(other, capsys, line):
    name = line.split()[0]
    assert main.main(line.split()) == 1
    out, err = capsys.readouterr()
    package = {"mute": "absent_words", "lack": "absent_package", "old": "other_words:former"}[name]
    assert out == ""
    assert err == f"lmmap: {name}: needs {package}, which is not installed; {plugins.INSTALL}\n"


def test_a_mistake_of_ours_is_not_told_as_a_missing_package(other):
    with pytest.raises(ModuleNotFoundError, match="absent"):
        main.main(["err"])


def test_the_command_names_no_other_package():
    """What ``--help`` shows of others comes from their entry points alone."""
    code = (
        "import sys; from lmmap import plugins; from lmmap.cli import main\n"
        "plugins.entry_points = lambda group: {}\n"
        "try: main.main(['--help'])\n"
        "except SystemExit: print(*sorted(name for name in sys.modules if name.startswith('lmmap')))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT).stdout
    assert "laboratory" not in out and "lmmap_lab" not in out and "lmmap.cli.main" in out.split()


def only(monkeypatch, groups: dict) -> None:
    """Nothing is installed beside lmmap and its readers but these entry points, by their group."""
    real = plugins.entry_points
    named = {plugins.READERS: real(plugins.READERS)} | groups
    monkeypatch.setattr(plugins, "entry_points", lambda group: named.get(group, {}))


STILL = """
import numpy as np
from lmmap.types import Pose, Trajectory

def still(path, rig):
    T = rig.T_cam_root @ rig.T_tip_port
    return Trajectory([0, 10**15], Pose(np.stack([T.rotation] * 2), np.stack([T.position_m] * 2)))
"""


def test_a_bag_with_a_rig_takes_its_truth_from_another_package(tmp_path, monkeypatch, capsys):
    """Without that package the line says what to install."""
    bag, recording = tmp_path / "r.bag", drawn.recording(3)
    write_recording(replace(recording, truth=None), bag)
    evaluate = ["evaluate", str(bag), "--modality", "rgb", "--rate", "10"]
    known = recording.truth.at(recording.frames_t_us[:1])[0]
    Rig("base", "tool0", known, Pose.identity(), 0.08).save(tmp_path / RIG_FILE)
    for entries in ({}, {"arm": "absent_words:truth"}):
        with monkeypatch.context() as patched:
            only(patched, {plugins.TRUTHS: entries})
            code = main.main(evaluate)
        err = capsys.readouterr().err
        assert code == 1 and "no ground truth" in err and plugins.INSTALL in err
        assert len(err.splitlines()) == 1
    (tmp_path / "still_words.py").write_text(STILL)
    monkeypatch.syspath_prepend(tmp_path)
    only(monkeypatch, {plugins.TRUTHS: {"s": "still_words:still"}})
    assert main.main([*evaluate, "--json"]) == 0
    report = json.loads(capsys.readouterr().out)["rgb"]
    assert report["images"] > 0 and report["position_error_median_mm"] < 20


def test_estimate_takes_networks_that_another_package_makes_of_the_recording(
    other, lmmap, monkeypatch, tmp_path
):
    def estimated(name, *options):
        path = tmp_path / name
        code, _, err = lmmap("estimate", drawn.file(), "--modality", "rgb", "--rate", 5, "-o", path, *options)
        return code, err, path

    with monkeypatch.context() as patched:
        only(patched, {})
        code, err, path = estimated("none.csv", "--adapt", 2)
    assert (code, err) == (1, f"lmmap: --adapt: needs the laboratory of the book; {plugins.INSTALL}\n")
    assert not path.exists()
    only(monkeypatch, {plugins.NETWORKS: {"adapt": "other_words:learned"}})
    code, _, path = estimated("adapted.csv", "--adapt", 2)
    assert code == 0
    same = estimated("same.csv", "--weights", tmp_path / "adapted.2s")[2]
    assert path.read_bytes() == same.read_bytes()
