"""Laws of the command line: no value is silently ignored, whatever the command and the option."""

import argparse
import re
from functools import cache
from types import SimpleNamespace

import drawn
import pytest

from lmmap.cli import arguments, main
from lmmap.cli.commands import Parser
from lmmap.cli.inputs import flips_of
from lmmap.types import InputError

DRAWN = drawn.file(4)


def parsers(parser: argparse.ArgumentParser, words=()) -> dict[tuple[str, ...], argparse.ArgumentParser]:
    """Each command's parser, also of commands below a command."""
    found = {} if not words else {words: parser}
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for name, below in action.choices.items():
                found |= parsers(below, (*words, name))
    return found


def options():
    """``(words of a command, option, a value of it)`` of all options that take a value."""
    for words, parser in parsers(arguments.parser()).items():
        for action in parser._actions:
            if action.option_strings and action.nargs != 0:
                value = action.choices[0] if action.choices else "3" if action.type in (int, float) else "x"
                yield words, action, value


@pytest.fixture(scope="module", autouse=True)
def parsed_by_one():
    """Making the parser takes most of a test's time."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(main, "parser", cache(arguments.parser))
        yield


def mistake(capsys, *argv) -> str:
    """The one line of a usage error."""
    with pytest.raises(SystemExit) as stop:
        main.main([str(a) for a in argv])
    out, err = capsys.readouterr()
    assert stop.value.code == 2 and out == "" and err.count("\n") == 1, err
    return err


def test_every_option_is_given_once_and_not_empty(capsys):
    tried = 0
    for words, action, value in options():
        for option in action.option_strings:
            if not isinstance(action, argparse._AppendAction):
                err = mistake(capsys, *words, option, value, action.option_strings[0], value)
                assert "is given twice; give it once" in err and option.lstrip("-") in err
            for none in ("", "--"):
                err = mistake(capsys, *words, f"{option}={none}" if option[1] == "-" else f"{option}{none}")
                assert re.search("is empty|is --|invalid|expected", err), option
            if action.type is int:
                err = mistake(capsys, *words, f"{option}={'9' * 400}")
                assert "expected a whole number of 64 bits, got 999" in err, option
            tried += 1
    assert tried > 40


def test_every_command_parses_as_ours_do():
    assert all(isinstance(parser, Parser) for parser in parsers(arguments.parser()).values())


def test_an_empty_argument_is_no_folder_here(capsys):
    assert "is empty" in mistake(capsys, "info", "")
    assert "is empty" in mistake(capsys, "draw", DRAWN, "", "--modality", "rgb", "-o", "x.mp4")
    assert "argument shell: is empty" in mistake(capsys, "completion", "")


@pytest.mark.parametrize("command", ["estimate", "evaluate", "live"])
def test_networks_are_named_once(capsys, command):
    err = mistake(capsys, command, DRAWN, "--weights", "x", "--networks", "low")
    assert "not allowed with" in err


def test_former_names_are_still_taken_with_a_line():
    words = ["estimate", "x.h5", "--modality", "rgb", "-o", "x.csv"]
    with pytest.warns(UserWarning, match="is|are now called") as told:
        a = arguments.parser().parse_args([*words, "--domain-gap", "light"])
    assert a.networks == "slim" and sorted(str(w.message) for w in told) == [
        "--domain-gap is now called --networks", "the networks 'light' are now called 'slim'",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("asked", "flips"),
    [
        (["x"], {"rgb": "x", "event": "x"}),
        (["rgb:y", "event:180"], {"rgb": "y", "event": "180"}),
        (["rgb:y", "x"], None),
        (["x", "event:x"], None),
        (["rgb:x", "rgb:y"], None),
    ],
)
def test_one_flip_a_camera(asked, flips):
    if flips:
        assert flips_of(SimpleNamespace(flip=asked)) == flips
        return
    with pytest.raises(InputError, match="already; give one for each camera, 180 for x and y"):
        flips_of(SimpleNamespace(flip=asked))


RGB = DRAWN, "--modality", "rgb"


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        (("live", *RGB, "--seconds", "0"), "--seconds 0: give a time above"),
        (("live", *RGB, "--seconds", "nan"), "--seconds nan: give a time above"),
        (
            ("live", "--modality", "rgb", "--camera", "c.json", "--fps", "5"),
            "no recording to which it applies; leave --fps out",
        ),
        (("info", "{}", "--fps", "0"), "--fps 0: give the pictures per second, over 0"),
        (("info", "n" * 300), "File name too long"),
        (("info", DRAWN, "--camera", "n" * 300 + ".json"), "File name too long"),
        (("estimate", *RGB, "--weights", "n" * 300, "-o", "{}/p.csv"), "n: no readable"),
        (("estimate", *RGB, "-o", "{}/" + "n" * 300 + ".csv"), "File name too long"),
        (("estimate", *RGB, "-o", "{}/o.avi", "--video", "{}/o.avi"), "is also read as"),
        (("estimate", *RGB, "--events", "9", "-o", "{}/p.csv"), "has no histograms; leave --events out"),
        (("evaluate", *RGB, "--events", "9"), "has no histograms; leave --events out"),
        (("live", DRAWN, "--events", "9"), "has no histograms; leave --events out"),
        (("live", "0", "--frame-id", "a"), "nothing is written without --output; leave --frame-id out"),
        (("live", "0", "-o", "{}/none/p.csv"), "no folder"),
        (("estimate", *RGB, "--format", "csv", "--frame-id", "a", "-o", "{}/p.bag"), "leave --frame-id out"),
        (("info", "/proc/kmsg"), "a device or a pipe"),
        (("estimate", *RGB, "--port", "/proc/kmsg", "-o", "{}/p.csv"), "a device or a pipe"),
    ],
    ids=range(17),
)
def test_remedies_are_for_what_is_wrong(tmp_path, lmmap, argv, said):
    code, out, err = lmmap(*(str(a).replace("{}", str(tmp_path)) for a in argv))
    assert (code, out) == (1, "") and err.count("\n") == 1 and said in err, err
    assert not list(tmp_path.iterdir())


def test_a_recording_whose_name_leaves_no_room_for_sidecars_is_read(tmp_path, lmmap):
    long = tmp_path / ("n" * 240 + DRAWN.suffix)
    long.write_bytes(DRAWN.read_bytes())
    code, out, err = lmmap("info", long)
    assert code == 0 and "frames" in out, err
