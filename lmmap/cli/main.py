"""The ``lmmap`` command.  Exit codes: 0 done, 1 bad input (one line on stderr), 2 usage, 130 interrupted."""

from __future__ import annotations

import os
import sys
import warnings
from contextlib import suppress

from ..files import InputError, tune_allocator
from .arguments import parser
from .plugins import call

MAX_LETTERS = 2000  # of a message; ours have some hundred, beside the path


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    arguments = parser().parse_args(argv)
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError, ValueError):  # names of files that are not UTF-8 are printed escaped
            stream.reconfigure(errors="backslashreplace")
    # threads that wait for work without spinning leave the cores to others; read when torch is imported
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    # numba's coloured errors have an escape sequence printed at exit
    os.environ.setdefault("NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING", "1")
    tune_allocator()
    try:
        with warnings.catch_warnings():
            _print_notes()
            call(arguments.command, arguments.run, arguments)  # --help does not wait for torch
    except InputError as error:
        print(f"lmmap: {_one_line(error)}", file=sys.stderr)
        return 1
    except MemoryError:
        print("lmmap: not enough memory; end other programs, or give a smaller recording", file=sys.stderr)
        return 1
    except KeyboardInterrupt as interrupt:
        print("; ".join(["lmmap: interrupted", *map(str, interrupt.args)]), file=sys.stderr)
        return 130
    except BrokenPipeError:  # the program that reads our output, such as head, has enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0


def _one_line(error: InputError) -> str:
    """Its message, in one line also where a name that it repeats from a file has several, or a million
    letters."""
    return " ".join(str(error).splitlines())[:MAX_LETTERS]


def _print_notes() -> None:
    """Print each of our warnings once and in one line, and none of the libraries' others."""
    printed = set()

    def show(message, *_):
        lines = str(message).strip().splitlines() or [""]
        if lines[0] not in printed:
            printed.add(lines[0])
            print(f"lmmap: note: {lines[0][:MAX_LETTERS]}", file=sys.stderr)

    warnings.simplefilter("ignore")
    warnings.simplefilter("always", UserWarning)
    warnings.showwarning = show
