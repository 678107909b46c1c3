"""Finished parts of a simulation on disk, so that an interrupted one goes on to the same bytes."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from lmmap.files import atomic, regular_file
from lmmap.types import EVENT, Camera
from lmmap_lab.unfinished import MARK, begin_folder, has_mark

from .event_sensor import EventSensor
from .hdf5_writer import new_file


def join(part: dict[str, list], camera: Camera) -> dict[str, np.ndarray]:
    """Events (M,), frames (N, H, W, 3) and their times (N,) of a part's pieces."""
    no_frames = np.empty((0, camera.height_px, camera.width_px, 3), np.uint8)
    return {
        "events": np.concatenate([np.empty(0, EVENT), *part["events"]]),
        "frames": np.stack(part["frames"]) if part["frames"] else no_frames,
        "frames_t_us": np.array(part["frames_t_us"], np.int64),
    }


def keep(folder: Path, index: int, part: dict) -> None:
    """Write a finished part, with the state in which it left the sensor."""
    with atomic(folder / f"{index:04d}.h5") as temporary, new_file(temporary) as file:
        for name, value in part.items():
            file[name] = value


def resume(folder: Path | None, event_sensor: EventSensor, mark: str) -> list[dict]:
    """The parts that an interrupted call of the same mark has finished; the sensor goes on from the last.

    Raises `InputError` for a folder that is not ours, or that cannot be written.
    """
    if folder is None:
        return []
    if not has_mark(folder / MARK, mark):
        begin_folder(folder, mark)
    finished = []
    for path in sorted(folder.glob("*.h5")):
        regular_file(path)
        try:
            with h5py.File(path) as file:
                finished.append({name: file[name][()] for name in file})
        except (ValueError, OSError, KeyError, RuntimeError):  # cut short: it is made anew
            break
    if finished:
        event_sensor.restore(finished[-1])
    return finished
