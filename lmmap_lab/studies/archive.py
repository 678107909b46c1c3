"""A sequence's results packed into one file, so that a study of hours can go on from a checkout elsewhere."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from lmmap.files import atomic
from lmmap.types import InputError

from ..provenance import provenance

PROVENANCE = "provenance.json"  # the entry that says what made the others; ``made_of`` is their fingerprint


def pack(path: Path, files: Iterable[Path], folder: Path, mark: str, **facts) -> Path:
    """Write ``files`` of ``folder`` and their provenance, with the fingerprint ``mark``, whole or not at all.

    The archive has the same bytes for the same contents.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    entries = {str(f.relative_to(folder)): f.read_bytes() for f in sorted(files)}
    return _write(path, entries, provenance(made_of=mark, **facts))


def carry_over(path: Path, mark: str, **sample) -> Path:
    """Give an archive another fingerprint, and say in its provenance by which sample of it."""
    facts = {
        key: value for key, value in provenance(**sample).items() if key in (*sample, "commit", "processor")
    }
    with _reading(path) as archive:
        made = provenance_of(path)
        entries = {name: archive.read(name) for name in archive.namelist() if name != PROVENANCE}
    carried = [*made.get("carried_over", []), facts | {"from": made["made_of"]}]
    return _write(path, entries, made | {"made_of": mark, "carried_over": carried})


def _write(path: Path, entries: dict[str, bytes], made: dict) -> Path:
    text = json.dumps(made, indent=1, sort_keys=True) + "\n"
    with atomic(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for name, content in (entries | {PROVENANCE: text.encode()}).items():
            # a ZipInfo's date is fixed, a file's own is not
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_LZMA)
    return path


def provenance_of(path: Path) -> dict:
    """What made an archive's results; empty where there is no archive; errors as `unpack`."""
    if not path.exists():
        return {}
    with _reading(path) as archive:
        return json.loads(archive.read(PROVENANCE))


def mark_of(path: Path) -> str | None:
    """The fingerprint of what made an archive's results, or None where there is no archive; errors as
    `unpack`."""
    return provenance_of(path).get("made_of")


def unpack(path: Path, folder: Path, mark: str | None = None) -> bool:
    """Put packed files back into ``folder`` if their fingerprint is ``mark``, or whatever it is.

    Returns
    -------
    bool
        Whether the archive is there and has this fingerprint.

    Raises
    ------
    InputError
        If the file is damaged.
    """
    if not path.exists() or (mark and mark_of(path) != mark):
        return False
    with _reading(path) as archive:
        archive.extractall(folder, [name for name in archive.namelist() if name != PROVENANCE])
    return True


@contextmanager
def _reading(path: Path) -> Iterator[zipfile.ZipFile]:
    try:
        with zipfile.ZipFile(path) as archive:
            yield archive
    except (zipfile.BadZipFile, KeyError, EOFError, ValueError, OSError, NotImplementedError) as error:
        raise InputError(f"{path}: no readable results ({error}); restore it or delete it") from None
