"""The parser of the ``lmmap`` command, to which subcommands are added one by one."""

from __future__ import annotations

import argparse
import warnings
from itertools import groupby
from pathlib import Path

from .. import plugins
from .choices import SETS, TIME_UNITS, present_set

OWN, OTHERS = "commands", "commands of the laboratory behind the book"

EXAMPLES = """examples:
  lmmap info run.aedat4
  lmmap estimate run.aedat4 --modality event -o poses.csv
  lmmap draw run.aedat4 poses.csv --modality event -o overlay.mp4
'lmmap COMMAND --help' shows more.
"""


class _Once(argparse._StoreAction):
    """Store an option's value, and its name in ``given``; refuse a second value, which would replace it."""

    def __call__(self, parser, namespace, values, option_string=None):
        given: frozenset[str] = getattr(namespace, "given", frozenset())
        if option_string and self.dest in given:
            raise argparse.ArgumentError(self, "is given twice; give it once")
        if option_string:
            namespace.given = given | {self.dest}
        super().__call__(parser, namespace, values, option_string)


def _whole(text: str) -> int:
    """An int of 64 bits; beyond it neither arrays nor random generators have one."""
    try:
        if abs(number := int(text)) < 2**63:
            return number
    except ValueError:
        pass
    raise argparse.ArgumentTypeError(f"expected a whole number of 64 bits, got {text:.30}")


class _Renamed(_Once):
    """Store the value of an option by its former name, with a warning."""

    def __call__(self, parser, namespace, values, option_string=None):
        warnings.warn(f"{option_string} is now called --{self.dest}", stacklevel=2)
        super().__call__(parser, namespace, values, option_string)


class Parser(argparse.ArgumentParser):
    """A parser that accepts each option once and no empty value, and reports a mistake in one line."""

    heading = ""  # under which help lists it

    def __init__(self, *args, **options):
        super().__init__(*args, **options)
        for name in (None, "store"):
            self.register("action", name, _Once)
        self.register("type", int, _whole)

    def _get_values(self, action, words: list[str]):
        if "" in words and action.nargs != argparse.PARSER:  # a subcommand's parser looks for it itself
            raise argparse.ArgumentError(action, "is empty; give a value")
        if action.option_strings and "--" in words:  # argparse would take it away
            raise argparse.ArgumentError(action, "is --; give a value")
        return super()._get_values(action, words)

    def error(self, message: str):
        """Print what is wrong, and exit."""
        self.exit(2, f"{self.prog}: {' '.join(message.split())}; see {self.prog} --help\n")


class _Listing(argparse.RawDescriptionHelpFormatter):
    """Help that lists the subcommands under headings."""

    def _format_action(self, action) -> str:
        if not isinstance(action, argparse._SubParsersAction):
            return super()._format_action(action)
        parts: list[str] = []
        for heading, commands in groupby(action._get_subactions(), lambda c: action.choices[c.dest].heading):
            parts += [f"\n{heading}:\n"] if parts else []  # the first is the section's own
            parts += map(super()._format_action, commands)
        return "".join(parts)


class Commands:
    """The parser of the command line, to which subcommands are added one by one."""

    def __init__(self, complete_files=None):
        self.complete_files, self._heading = complete_files, OWN
        self.parser = Parser(
            "lmmap",
            description="Estimate the pose of the LM-MAP docking port from an RGB or event camera.",
            epilog=EXAMPLES,
            formatter_class=_Listing,
        )
        text = "print the version of lmmap and exit"
        number = f"lmmap {plugins.version() or 'of a checkout that is not installed'}"
        self.parser.add_argument("--version", action="version", version=number, help=text)
        named = {"title": OWN, "dest": "command", "metavar": "COMMAND"}
        self._commands = self.parser.add_subparsers(required=True, **named)

    def add(self, name: str, run: str, text: str, examples: str = "", **options) -> argparse.ArgumentParser:
        """Add a subcommand whose work is done by ``run``, a function named as ``module:function``."""
        description = text[0].upper() + text[1:]
        form = argparse.RawDescriptionHelpFormatter
        command = self._commands.add_parser(
            name, help=text, description=description, epilog=examples, formatter_class=form, **options
        )
        command.heading = self._heading
        command.set_defaults(run=run, given=frozenset())
        return command

    def add_installed(self) -> None:
        """Add other packages' subcommands, unless one of ours has that name; a subcommand that cannot be
        imported says so when it is run."""
        self._heading = OTHERS
        for name, add in plugins.entry_points(plugins.COMMANDS).items():
            if name in self._commands.choices:
                continue
            try:
                plugins.call(name, add, self)
            except plugins.NotInstalled as reason:
                text, run = f"needs {plugins.INSTALL}", "lmmap.plugins:refuse"
                command = self.add(name, run, text, prefix_chars="\0", add_help=False)
                command.add_argument("anything", nargs="*")  # options, too, since none has their prefix
                command.set_defaults(reason=reason)

    def add_file(self, command, *names: str, **options) -> None:
        """Add an argument that is a file's name, which the shell can complete."""
        action = command.add_argument(*names, **({"metavar": "FILE", "type": Path} | options))
        if self.complete_files is not None:
            action.complete = self.complete_files

    def add_networks(self, command, text: str) -> None:
        """Add an option that names a shipped set of networks."""
        options = {"type": present_set, "choices": SETS}
        command.add_argument("--networks", help=text, **options)
        hidden = {"action": _Renamed, "dest": "networks", "help": argparse.SUPPRESS}
        command.add_argument("--domain-gap", **hidden, **options)

    def add_output(self, command, text: str, **options) -> None:
        """Add the options ``--output`` and ``--overwrite``."""
        self.add_file(command, "-o", "--output", help=text, **options)
        command.add_argument("--overwrite", action="store_true", help="replace an existing output")

    def add_recording(self, command, **options) -> None:
        """Add the arguments that open a recording of any format."""
        text = "AEDAT4, RAW, DAT, ES, HDF5, ROS 1 or 2 bag, text, CSV, npy, video, image, folder of images"
        self.add_file(command, "recording", **({"metavar": None, "help": text} | options))
        text = ("calibration: our JSON or a file of OpenCV, ROS, Kalibr, DV, Metavision or COLMAP (FILE:NAME "
                "picks one camera); or a sensor and its nominal lens, such as evk4:8mm")  # fmt: skip
        self.add_file(command, "--camera", help=text)
        text = "pictures per second in a folder without timestamps.txt"
        command.add_argument("--fps", type=float, metavar="HZ", help=text)
        text = "unit of times if the file states none: events in text, CSV, npy or HDF5, pictures in a folder"
        command.add_argument("--time-unit", choices=TIME_UNITS, help=text)
        text = "which of several cameras: a stream's number in AEDAT4, a group such as davis/right in HDF5"
        command.add_argument("--stream", metavar="NAME", help=text)
