"""The ``lmmap`` command.  Exit codes: 0 done, 1 bad input (one line on stderr), 2 usage, 130 interrupted."""

from __future__ import annotations

import os
import sys
import warnings
from contextlib import contextmanager, suppress
from typing import Any

from ..allocator import tune_allocator
from ..errors import InputError
from ..plugins import call
from .arguments import parser

MAX_LETTERS = 2000  # of a message; ours have some hundred, beside the path


def main(argv: list[str] | None = None) -> int:
    """Run the command and return its exit code."""
    closed = sys.stdout is None  # files that are opened next would else take its descriptor
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115
    try:
        try:
            if closed:
                raise InputError("stdout: is closed; redirect it to a file or /dev/null")
            with _notes():
                return _run(argv)
        finally:
            sys.stdout.flush()
    except InputError as error:
        return _fail(str(error))
    except MemoryError:
        return _fail("not enough memory; end other programs, or give a smaller recording")
    except KeyboardInterrupt as interrupt:
        print("; ".join(["lmmap: interrupted", *map(str, interrupt.args)]), file=sys.stderr)
        return 130
    except OSError as error:
        if error.errno is None:  # of a library, in words
            return _fail(str(error))
        if error.filename is not None:
            return _fail(f"{error.filename}: {error.strerror}; check its path and its permissions")
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what is left to print is lost
        if isinstance(error, BrokenPipeError):  # the program that reads our output, such as head, has enough
            return 0
        return _fail(f"stdout: cannot write ({error.strerror}); send it to a file on a disk with room")


def _run(argv: list[str] | None) -> int:
    arguments = parser().parse_args(argv)
    stream: Any
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError, ValueError):  # names of files that are not UTF-8 are printed escaped
            stream.reconfigure(errors="backslashreplace")
    # threads that wait for work without spinning leave the cores to others; read when torch is imported
    os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
    # numba's coloured errors have an escape sequence printed at exit
    os.environ.setdefault("NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING", "1")
    # FFmpeg and OpenCV write lines of their own to stderr, where ours says what is wrong
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    tune_allocator()
    call(arguments.command, arguments.run, arguments)  # --help does not wait for torch
    sys.stdout.flush()
    return 0


def _fail(message: str) -> int:
    line = " ".join(message.splitlines())[:MAX_LETTERS]  # also where a name has several lines
    print(f"lmmap: {line}", file=sys.stderr)
    return 1


@contextmanager
def _notes():
    """Print each of our warnings once and in one line, and none of the libraries' others.

    On a terminal they come at once, else when the command has ended; an error stands alone, in one line.
    """
    waiting: list[str] = []
    known: set[str] = set()

    def tell() -> None:
        while waiting:
            print(f"lmmap: note: {waiting.pop(0)}", file=sys.stderr)

    def show(message, *_):
        line = (str(message).strip().splitlines() or [""])[0][:MAX_LETTERS]
        if line not in known:
            known.add(line)
            waiting.append(line)
        if sys.stderr.isatty():
            tell()

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.simplefilter("always", UserWarning)
        warnings.showwarning = show
        try:
            yield
        except BrokenPipeError:
            raise
        except (InputError, MemoryError, OSError, SystemExit):
            waiting.clear()
            raise
        finally:
            tell()
