"""The laboratory's commands, as the ``lmmap`` command finds them."""

import argparse
import importlib
import json
import os
import pty
import re
import subprocess
import sys
import tomllib

from lmmap import plugins
from lmmap.cli import arguments, main
from lmmap.pipeline.weights import FILTERS
from lmmap_lab.adaptation import learning
from lmmap_lab.bench import laboratory
from lmmap_lab.bench.writers import WRITERS
from lmmap_lab.cli import arguments as words
from lmmap_lab.provenance import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
NAMES = PROJECT["entry-points"]["lmmap.commands"]


def test_the_installation_has_the_entry_points_of_the_checkout():
    """If not, install the checkout again (``make env``)."""
    for group, entries in PROJECT["entry-points"].items():
        assert entries.items() <= plugins.entry_points(group).items()


def test_every_entry_point_adds_the_command_of_its_name_and_names_functions_that_exist():
    commands = arguments.parser()._subparsers._group_actions[0].choices
    for name, function in NAMES.items():
        assert function == f"lmmap_lab.cli.arguments:{name}"
        runs = {commands[name].get_default("run")} - {""}
        for action in commands[name]._actions:
            if isinstance(action, argparse._SubParsersAction):
                runs |= {p.get_default("run") for p in action.choices.values()}
        assert runs
        for module, _, function in (run.partition(":") for run in runs):
            assert callable(getattr(importlib.import_module(module), function))


def test_truths_are_functions_that_exist():
    for value in PROJECT["entry-points"]["lmmap.truths"].values():
        module, _, function = value.partition(":")
        assert callable(getattr(importlib.import_module(module), function))


def test_choices_are_those_of_the_modules_that_own_them():
    assert tuple(FILTERS) == words.FILTERS
    assert tuple(laboratory.SECONDS) == words.PROFILES and tuple(WRITERS) == words.WRITTEN
    assert learning.STEPS == words.ADAPT_STEPS


def test_help_does_not_wait_for_the_heavy_imports():
    code = (
        "import sys; from lmmap.cli import main\n"
        "try: main.main(['train', '--help'])\n"
        "except SystemExit: print(*sorted({name.split('.')[0] for name in sys.modules}))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT).stdout
    assert "--networks" in out and "lmmap_lab" in out.split()
    assert not {"torch", "numba", "pandas", "scipy", "cv2", "numpy"} & set(out.splitlines()[-1].split())


def test_what_is_simulated_is_a_sound_recording_with_its_truth(tmp_path, capsys):
    demo = tmp_path / "demo.aedat4"
    assert main.main(["simulate", "--sequence", "test-medium", "--seconds", "0.4", "-o", str(demo)]) == 0
    assert "events" in capsys.readouterr().out and demo.with_suffix(".truth.csv").exists()
    assert main.main(["info", str(demo), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["frames"] == 8 and facts["truth"]
    assert main.main(["evaluate", str(demo), "--modality", "rgb", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["rgb"]["images"] == 8


def test_only_the_paper_profile_is_packed(capsys):
    for asked in (["--profile", "quick"], ["--profile", "paper", "--data", "bags"]):
        assert main.main(["reproduce", "--go-on", *asked]) == 1
        out, err = capsys.readouterr()
        assert out == "" and re.fullmatch("lmmap: --go-on: .+; .+\n", err)


def test_a_terminal_is_left_as_it_was(tmp_path):
    """What compiles behind the bench sends no colours there when the process ends."""
    main, terminal = pty.openpty()
    command = [sys.executable, "-m", "lmmap", "simulate", "--sequence", "test-low", "--seconds", "0.05"]
    with open(terminal, "wb", closefd=True) as out:
        argv = [*command, "-o", str(tmp_path / "s.aedat4")]
        subprocess.run(argv, stdout=out, stderr=out, check=True)
    shown = os.read(main, 4096)
    os.close(main)
    assert b"events" in shown and b"\x1b" not in shown
