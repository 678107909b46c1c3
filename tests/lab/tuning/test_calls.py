"""The scripts of tuning take the calls that their docstrings show."""

import argparse
import importlib
import re
import subprocess
import sys
from pathlib import Path

import pytest

from lmmap_lab.bench import sequences

ROOT = Path(__file__).parents[3]
CALL = re.compile(r"^ +python tuning/\w+\.py([^\[#\n]*)", re.MULTILINE)
PARSE = argparse.ArgumentParser.parse_args
SOURCES = {path.stem: path.read_text() for path in sorted((ROOT / "tuning").glob("*.py"))}
CALLS = [(script, call.strip()) for script, source in SOURCES.items() if "parse_args()" in source
         for call in CALL.findall(source.split('"""')[1])]  # fmt: skip


class ParsedError(Exception):
    """The arguments are fine; nothing is run."""


def simulate(*args, **options):
    pytest.fail("The script simulates before it has read its arguments.")


@pytest.mark.parametrize(("script", "call"), CALLS)
def test_a_documented_call_is_accepted_before_anything_is_made(script, call, monkeypatch):
    def parse(self, *args):
        PARSE(self, *args)
        raise ParsedError

    monkeypatch.setattr(sequences, "simulate", simulate)
    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", parse)
    monkeypatch.setattr(sys, "argv", [script, *call.split()])
    with pytest.raises(ParsedError):
        importlib.import_module(script).main()


def test_the_other_laboratory_finds_the_path_tracers_scene_by_itself():
    program = (
        "import sys; sys.path[0] = 'tuning'; import validation_world;"
        "from importlib.util import find_spec; assert find_spec('mitsuba_scene')"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
