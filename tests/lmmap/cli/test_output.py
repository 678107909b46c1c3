"""What a command prints: all of it, or one line that says why not."""

import os
import subprocess
import sys
import warnings

import drawn
import pytest

from lmmap import plugins
from lmmap.cli import main
from lmmap.shipped import ROOT
from lmmap.types import InputError

DRAWN = drawn.file(4)


@pytest.fixture
def command(monkeypatch):
    """Have ``lmmap info`` do something else."""

    def replace(function):
        monkeypatch.setattr(main, "call", lambda *_: function())

    return replace


def test_an_error_is_one_line_also_after_notes(command, lmmap):
    def notes(then=None):
        for text in ("first\nmore", "second", "first"):
            warnings.warn(text, stacklevel=1)
        if then:
            raise then

    command(lambda: notes(InputError("x: y; z")))
    assert lmmap("info", DRAWN) == (1, "", "lmmap: x: y; z\n")
    command(notes)
    assert lmmap("info", DRAWN) == (0, "", "lmmap: note: first\nlmmap: note: second\n")
    command(lambda: notes(KeyboardInterrupt("p.csv keeps it")))
    assert lmmap("info", DRAWN)[2].splitlines()[-1] == "lmmap: interrupted; p.csv keeps it"


def test_on_a_terminal_notes_come_at_once(command, lmmap, monkeypatch):
    def tell():
        warnings.warn("first", stacklevel=1)
        print("work", file=sys.stderr)

    command(tell)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True, raising=False)
    assert lmmap("info", DRAWN)[2] == "lmmap: note: first\nwork\n"


def test_a_refusal_of_the_system_names_the_file(command, lmmap):
    command(lambda: open("/nonsense/x"))  # noqa: SIM115
    assert lmmap("info", DRAWN)[2].startswith("lmmap: /nonsense/x: No such file or directory; ")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no device that is always full")
def test_a_full_or_closed_stdout_is_one_line():
    words = [sys.executable, "-m", "lmmap", "completion", "bash"]
    for redirect, said in ((">/dev/full", "cannot write (No space left on device)"), (">&-", "is closed")):
        run = subprocess.run(
            ["sh", "-c", f'"$@" {redirect}', "sh", *words], cwd=ROOT, text=True, capture_output=True
        )
        assert run.returncode == 1 and run.stderr.startswith("lmmap: stdout: ") and said in run.stderr
        assert run.stderr.count("\n") == 1


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="this system has no device that is always full")
def test_a_full_stdout_is_one_line_also_after_notes(command, monkeypatch, capsys):
    def tell():
        warnings.warn("a note", stacklevel=1)
        print("an answer")

    command(tell)
    with open("/dev/full", "w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        assert main.main(["info", str(DRAWN)]) == 1
    err = capsys.readouterr().err
    assert err.startswith("lmmap: stdout: cannot write (No space left") and err.count("\n") == 1


def test_a_missing_module_without_a_name_is_a_missing_package(monkeypatch):
    def lacks():
        raise ModuleNotFoundError("something is missing")

    monkeypatch.setattr(sys.modules[__name__], "lacks", lacks, raising=False)
    monkeypatch.setitem(sys.modules, "other_words", sys.modules[__name__])
    with pytest.raises(plugins.NotInstalled, match="x: needs other_words:lacks, which is not installed"):
        plugins.call("x", "other_words:lacks")
