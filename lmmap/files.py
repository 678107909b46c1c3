"""Files: written whole or not at all, and found beside one another."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from .camera_files import InputError

CAMERA = "camera.json"  # the calibration that a folder of bags shares


@contextmanager
def atomic(path) -> Iterator[Path]:
    """A temporary path in the folder of ``path`` that takes its name when the block succeeds.

    On any error nothing remains; an `OSError` (full disk, no permission) becomes an `InputError`.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")
    try:
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        raise InputError(
            f"{path}: cannot write ({error.strerror or error}); choose a folder with room that you may write"
        ) from None
    finally:
        with suppress(OSError):  # the folder itself may be missing or no folder: nothing was written
            temporary.unlink(missing_ok=True)


def beside(path, name: str) -> Path | None:
    """A file that serves a folder of bags: in a bag's folder, or in the one above."""
    folder = Path(path).resolve().parent
    return next((p / name for p in (folder, folder.parent) if (p / name).exists()), None)
