"""Sequences of the bench written to files: several at once, here or on a Dask cluster.

An interrupted call goes on where it stopped.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import joblib

from lmmap.types import Camera, InputError
from lmmap_lab.unfinished import remove_folder

from . import sequences
from .writers import write_recording


def record(name: str, seconds: float, path, progress=None, camera: Camera | None = None) -> tuple[int, int]:
    """Simulate a sequence into a file; returns the numbers of its events and frames.

    Finished parts lie in a folder ``NAME.parts`` beside ``path`` until the file is whole.
    """
    path = Path(path)
    parts = path.with_name(path.name + ".parts")
    recording = sequences.simulate(name, seconds, progress, camera=camera, parts=parts)
    write_recording(recording, path)
    remove_folder(parts)
    return len(recording.events), len(recording.frames)


def record_all(jobs, workers: int = 1, scheduler: str | None = None) -> Iterator[tuple[Path, int, int]]:
    """`record` each ``(name, seconds, path)``, in parallel; yields ``(path, events, frames)``.

    Parameters
    ----------
    scheduler
        Address of a Dask scheduler.  Its workers then do the work; they must see the same files.

    Raises
    ------
    InputError
        As `record`; or if a scheduler is given and the package ``distributed`` is missing.
    """
    tasks = [joblib.delayed(_record_job)(*job) for job in jobs]
    if scheduler is None:
        yield from joblib.Parallel(n_jobs=workers, return_as="generator")(tasks)
        return
    try:
        from distributed import Client
    except ImportError:
        raise InputError(
            f"{scheduler}: a Dask cluster needs one more package; pip install distributed"
        ) from None
    try:
        client = Client(scheduler, timeout=10)
    except (OSError, ValueError) as error:
        raise InputError(
            f"{scheduler}: no Dask scheduler answers ({error}); start one or check the address"
        ) from None
    with client, joblib.parallel_config(backend="dask"):
        yield from joblib.Parallel()(tasks)


def _record_job(name: str, seconds: float, path: Path) -> tuple[Path, int, int]:
    return (path, *record(name, seconds, path))
