"""A sequence's results packed into one file, so that a study of hours can go on from a checkout elsewhere."""

from __future__ import annotations

import zipfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from lmmap.files import atomic
from lmmap.types import InputError

MARK = "made-of"  # the entry with the fingerprint of what made the others


def pack(path: Path, files: Iterable[Path], folder: Path, mark: str) -> Path:
    """Write ``files`` of ``folder`` and the fingerprint ``mark`` of what made them, whole or not at all.

    The archive has the same bytes for the same contents.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        entries = {str(f.relative_to(folder)): f.read_bytes() for f in sorted(files)} | {MARK: mark.encode()}
        for name, content in entries.items():  # a ZipInfo's date is fixed, a file's own is not
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_LZMA)
    return path


def mark_of(path: Path) -> str | None:
    """The fingerprint of what made an archive's results, or None where there is no archive; errors as
    `unpack`."""
    if not path.exists():
        return None
    with _reading(path) as archive:
        return archive.read(MARK).decode()


def unpack(path: Path, folder: Path, mark: str) -> bool:
    """Put packed files back into ``folder`` if their fingerprint is ``mark``.

    Returns
    -------
    bool
        Whether the archive is there and has this fingerprint.

    Raises
    ------
    InputError
        If the file is damaged.
    """
    if mark_of(path) != mark:
        return False
    with _reading(path) as archive:
        archive.extractall(folder, [name for name in archive.namelist() if name != MARK])
    return True


@contextmanager
def _reading(path: Path) -> Iterator[zipfile.ZipFile]:
    try:
        with zipfile.ZipFile(path) as archive:
            yield archive
    except (zipfile.BadZipFile, KeyError, EOFError, ValueError, OSError, NotImplementedError) as error:
        raise InputError(f"{path}: no readable results ({error}); restore it or delete it") from None
