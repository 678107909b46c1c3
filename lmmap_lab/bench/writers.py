"""Recordings to files, with the camera and the truth beside them, as `lmmap.recordings.formats` opens them.

A file is complete under its name, or it is not there.
"""

from __future__ import annotations

from pathlib import Path

from lmmap.files import atomic
from lmmap.recordings.order import checked_events, checked_frames
from lmmap.recordings.pose_files import write_trajectory
from lmmap.types import InputError, Recording

from . import aedat4_writer, hdf5_writer, rosbag_writer

WRITERS = {
    ".aedat4": aedat4_writer.write,
    ".bag": rosbag_writer.write,
    ".h5": hdf5_writer.write,
    ".hdf5": hdf5_writer.write,
}


def write_recording(recording: Recording, path) -> None:
    """Write in the format that the name ends in, the camera and the truth beside it; raises `InputError`.

    Nothing gets its name before everything is written: on a full disk, what was there stays.
    """
    path, r = Path(path), recording
    if path.suffix not in WRITERS:
        raise InputError(
            f"{path}: cannot write '{path.suffix}'; expected a name that ends in {', '.join(WRITERS)}"
        )
    for _ in (
        *checked_events(r.chunks(), r.camera.size_px),
        *checked_frames(r.timed_frames(), r.camera.size_px),
    ):
        pass  # ValueError: the caller's fault, found before anything is written
    truth = path.with_suffix(".truth.csv")
    with atomic(path) as temporary:
        WRITERS[path.suffix](r, temporary)
        with atomic(path.with_suffix(".camera.json")) as camera:
            r.camera.save(camera)
            if r.truth is not None:
                write_trajectory(r.truth, truth)
            else:  # one of another recording would be taken for this one's
                truth.unlink(missing_ok=True)
