"""Exchange of files with other odometries: what they need to run, and the errors of their trajectories.

The ``lmmap odometry`` command.  Nothing here imports another odometry.
"""

from __future__ import annotations

import json
import os
from argparse import Namespace
from pathlib import Path

import cv2
import numpy as np

from lmmap.disk import is_special
from lmmap.files import atomic, temporary, writes
from lmmap.pipeline.histograms import histogram, middle_us, windows_before
from lmmap.recordings.formats import open_recording
from lmmap.recordings.pose_files import read_truth, write_trajectory
from lmmap.settings import PAPER
from lmmap.types import InputError, Recording

from ..bench.writers import write_recording
from . import odometry

BLUR_PX, FULL_SCALE = 1.0, 4.0  # of event frames: Gaussian blur; blurred count that is white
FRAME_HZ = 20.0


def event_frame(events, size_px) -> np.ndarray:
    """Grey 8-bit image of a window of events: counts of both polarities, blurred and clipped.

    Signed histograms flip their sign when the camera turns back, and no tracker follows that.
    """
    counts = histogram(events["x"], events["y"], size_px).astype(np.float32)
    return np.minimum(cv2.GaussianBlur(counts, (0, 0), BLUR_PX) * (255 / FULL_SCALE), 255).astype(np.uint8)


def event_frames(recording: Recording, rate_hz: float = FRAME_HZ):
    """Yield ``(t_us, image)``: the last N events before each tick, at the middle of their span."""
    e = recording.events
    ticks = np.arange(e["t_us"][0], e["t_us"][-1], 1e6 / rate_hz).astype(np.int64) if len(e) else []
    for window in windows_before(e, ticks, PAPER.events_per_window):
        if window is not None:
            events = e[window]
            yield middle_us(events), event_frame(events, recording.camera.size_px)


def export(recording: Recording, folder: Path, bag: bool = True) -> dict[str, int]:
    """Write ``recording.bag``, ``rgb/`` and ``event/`` with their lists, ``camera.json``, ``truth.tum``.

    Returns the number of images of each modality.  Images are as recorded, with lens distortion.  What was
    there under these names stays until everything is written.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    folder = Path(os.path.realpath(folder))
    with writes(folder):
        folder.parent.mkdir(parents=True, exist_ok=True)
    with writes(folder), temporary(folder) as new:
        counts = _write_files(recording, new, bag)
        targets = {path: folder / path.relative_to(new) for path in sorted(new.rglob("*")) if path.is_file()}
        for target in targets.values():
            if is_special(target) or target.is_dir():  # before any is replaced
                raise InputError(
                    f"{target}: is a folder, a device or a pipe; give another folder for the export"
                )
        for path, target in targets.items():
            target.parent.mkdir(parents=True, exist_ok=True)
            with atomic(target) as part:
                os.replace(path, part)
    return counts


def _write_files(recording: Recording, folder: Path, bag: bool) -> dict[str, int]:
    streams = {
        "rgb": zip(recording.frames_t_us.tolist(), recording.frames[..., ::-1], strict=True),
        "event": event_frames(recording),
    }
    counts = {name: _write_images(folder, name, images) for name, images in streams.items()}
    if bag:
        write_recording(recording, folder / "recording.bag")
    recording.camera.save(folder / "camera.json")
    if recording.truth is not None:
        write_trajectory(recording.truth, folder / "truth.tum", "tum")
    return counts


def _write_images(folder: Path, name: str, images) -> int:
    (folder / name).mkdir(parents=True, exist_ok=True)
    lines, last_us = ["# seconds file"], None
    for number, (t_us, image) in enumerate(images):
        if t_us == last_us:
            continue
        path, last_us = f"{name}/{number:06d}.png", t_us
        (folder / path).write_bytes(cv2.imencode(".png", image)[1])  # libpng's own errors go to stderr
        lines.append(f"{t_us // 10**6}.{t_us % 10**6:06d} {path}")
    (folder / f"{name}.txt").write_text("\n".join(lines) + "\n")
    return len(lines) - 1


def export_command(a: Namespace) -> None:
    """``lmmap odometry export``."""
    if a.folder.is_dir() and any(a.folder.iterdir()) and not a.overwrite:
        raise InputError(f"{a.folder}: holds files already; give a new folder, or --overwrite")
    for source in filter(None, (a.recording, a.camera)):
        if Path(os.path.realpath(source)).is_relative_to(os.path.realpath(a.folder)):
            raise InputError(f"{a.folder}: holds {source}, which is read; give another folder")
    how = {"fps": a.fps, "time_unit": a.time_unit, "stream": a.stream}
    recording = open_recording(a.recording, a.camera, **how)
    counts = export(recording, a.folder)
    events = len(recording.events)
    print(f"{a.folder}: {counts['rgb']} frames, {counts['event']} event frames, a bag with {events} events")


def reference_trajectory(path: Path):
    """The truth beside a recording, or a trajectory file itself; raises `InputError`."""
    if not path.exists():
        raise InputError(f"{path}: no such file; check the path")
    if path.suffix in (".csv", ".tum", ".txt"):
        return read_truth(path)
    truth = path.with_suffix(".truth.csv")
    if not truth.exists():
        raise InputError(f"{path}: no ground truth beside it; put it in {truth.name}")
    return read_truth(truth)


def score_command(a: Namespace) -> None:
    """``lmmap odometry score``."""
    if a.trajectory.suffix not in (".tum", ".txt", ".csv"):
        raise InputError(
            f"{a.trajectory}: cannot read '{a.trajectory.suffix}'; write TUM lines to a .tum file"
        )
    try:
        table = odometry.score(odometry.read_tracks(a.trajectory), reference_trajectory(a.reference))
    except odometry.NotScored as error:
        raise InputError(f"{a.trajectory}: {error}") from None
    rows = odometry.by_length(table)
    if a.json:
        print(json.dumps(rows.to_dict("records"), indent=1))
        return
    print(f"{'length (m)':>10} {'stretches':>9} {'median (mm)':>11} {'rotation (deg)':>14}")
    for row in rows.itertuples():
        mm = 1000 * row.median_m
        print(f"{row.length_m:10.3f} {row.stretches:9d} {mm:11.2f} {row.rotation_median_deg:14.2f}")
