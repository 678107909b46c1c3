"""Files: read only if regular and within a size limit, written whole or not at all."""

from __future__ import annotations

import os
import shutil
import stat
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from .disk import is_special, lock, open_special, part_of, temporary, writes
from .errors import InputError

__all__ = [
    "CAMERA", "atomic", "beside", "check_folder_of", "check_output", "is_special", "lock",
    "open_special", "read_text", "regular_file", "temporary", "write_text", "writes",
]  # fmt: skip
CAMERA = "camera.json"  # the calibration that a folder of bags shares


def regular_file(path, max_bytes: int | None = None) -> Path:
    """Return the path if it is that of a regular file of at most ``max_bytes``; else raise `InputError`.

    Devices, pipes and the system's own files are refused because reading them may never end.
    """
    path = Path(path)
    try:
        facts = os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        raise InputError(f"{path}: no such file; check the path") from None
    except (OSError, ValueError) as error:  # a name that is too long or holds a zero byte
        raise InputError(f"{path}: cannot open ({error}); check the path") from None
    of_system = os.path.realpath(path).startswith(("/proc/", "/sys/"))  # reading /proc/kmsg never ends
    if not stat.S_ISREG(facts.st_mode) or of_system:
        kind = "a folder" if stat.S_ISDIR(facts.st_mode) else "a device or a pipe"
        raise InputError(f"{path}: is {kind}, not a file; name a file on a disk")
    if max_bytes is not None and facts.st_size > max_bytes:
        raise InputError(f"{path}: has {facts.st_size} bytes, more than {max_bytes}; name the right file")
    return path


def read_text(path, max_bytes: int) -> str:
    """Read a text file of at most ``max_bytes``; raises `InputError`."""
    path = regular_file(path, max_bytes)
    try:
        return path.read_text(encoding="utf-8-sig")  # as Windows begins a text
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is not text in UTF-8"
        raise InputError(f"{path}: cannot read this file ({reason}); name a text file") from None


@contextmanager
def atomic(path, keep: bool = False) -> Iterator[Path]:
    """A temporary path for a file or a folder, which becomes ``path`` when the block succeeds.

    After an error, whatever was at ``path`` is unchanged and nothing remains of the new file.  If ``path`` is
    a link, the file that it names is replaced; a device or a pipe is written to when the block succeeds.
    The folder of ``path`` must exist.

    Parameters
    ----------
    keep
        After an error other than the disk's, keep the new file if there was no old one.

    Raises
    ------
    InputError
        In place of an `OSError`, such as a full disk or a missing permission.
    """
    with writes(path), ExitStack() as held:
        if is_special(path):
            sink = held.enter_context(open_special(path))
            part = Path(held.enter_context(TemporaryDirectory()), Path(path).name)
            yield part
            with part.open("rb") as whole:
                shutil.copyfileobj(whole, sink)
            return
        target = Path(os.path.realpath(path))
        part = held.enter_context(temporary(target))
        try:
            yield part
        except OSError:
            raise
        except BaseException:
            if keep and part.exists() and not target.exists():
                os.replace(part, target)
            raise
        os.replace(part, target)


def write_text(path, text: str) -> Path:
    """Write a text file, whole or not at all, and create its folder if it is missing; raises `InputError`."""
    path = Path(path)
    with writes(path):
        path.parent.mkdir(parents=True, exist_ok=True)
    with atomic(path) as part:
        part.write_text(text, encoding="utf-8")
    return path


def check_folder_of(path) -> None:
    """Raise `InputError` unless the folder of an output exists."""
    path = Path(path)
    if not path.parent.is_dir():
        raise InputError(f"{path}: no folder {path.parent}; make it first")


def check_output(path, inputs: Iterable = (), *, overwrite: bool = False) -> Path:
    """Return the path of an output that may be written: a new file or, with ``overwrite``, any but an input.

    Raises
    ------
    InputError
        If it cannot be written, or if writing it would destroy something.
    """
    check_folder_of(path)
    path = Path(path)
    folder, there = path.parent, os.path.exists(path)
    if os.path.isdir(path):
        raise InputError(f"{path}: is a folder; give the name of a file")
    if not os.access(path if there else folder, os.W_OK):
        raise InputError(f"{path}: cannot write there; choose a folder in which you may write")
    if is_special(path):
        return path
    for name in (path, part_of(path)):  # links in a circle, and names that are too long
        with writes(path), suppress(FileNotFoundError):
            os.stat(name)
    for source in map(Path, filter(None, inputs)):
        within = os.path.isdir(source) and there and folder.samefile(source)
        if within or os.path.realpath(path) == os.path.realpath(source):
            raise InputError(f"{path}: is also read as {source}; give the output another name")
    if there and not overwrite:
        raise InputError(f"{path}: exists; give another name, or --overwrite to replace it")
    return path


def beside(path, name: str) -> Path | None:
    """Find a file that a folder of bags shares, in a bag's folder or the one above; None if in neither."""
    folder = Path(os.path.realpath(path)).parent
    return next((p / name for p in (folder, folder.parent) if os.path.exists(p / name)), None)
