"""Recordings as files, ours and foreign.

``open_recording`` turns a foreign file into a checked `Recording`; nothing behind it has to ask again
whether time runs forward or coordinates lie on the sensor.  Beside a recording ``NAME.aedat4`` lie
``NAME.camera.json`` (the calibration) and, where it is known, ``NAME.truth.csv`` or ``.truth.tum``.
Writers are atomic: a file is complete under its name, or it is not there.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from scipy.ndimage import maximum_filter

from . import aedat4, bags, hdf5, plain
from .core import EVENT, PAPER, Camera, InputError, Recording
from .trajectories import (
    atomic,
    read_estimates,
    read_trajectory,
    trajectory_of,
    write_estimates,
    write_trajectory,
)

__all__ = [
    "FORMATS",
    "health",
    "open_recording",
    "read_estimates",
    "read_trajectory",
    "trajectory_of",
    "write_aedat4",
    "write_estimates",
    "write_npz",
    "write_recording",
    "write_trajectory",
]

DAVIS346_PX = (346, 260)


def open_recording(path, camera: Camera | str | Path | None = None) -> Recording:
    """Read any of `FORMATS`, with the camera and truth beside it; raises `InputError`.

    ``camera`` (or a calibration file) wins over ``NAME.camera.json``.  Without either, a recording of
    346 x 260 px gets the nominal DAVIS 346 camera, with a warning.
    """
    path = Path(path)
    if not path.exists():
        raise InputError(f"{path}: no such file; check the path")
    kind = "folder" if path.is_dir() else path.suffix.lower()
    if kind not in READERS:
        raise InputError(f"{path}: cannot read '{path.suffix}'; read now: {', '.join(READERS)}")
    events, frames, frames_t_us, size_px = READERS[kind](path)
    camera = _camera(path, size_px, camera)
    size_px = camera.size_px
    if frames is None:
        frames = np.zeros((0, size_px[1], size_px[0], 3), np.uint8)
    if fault := _fault(events, frames, frames_t_us, size_px):
        raise InputError(f"{path}: {fault}")
    for array in (events, frames, frames_t_us):
        array.setflags(write=False)
    beside = [p for p in (path.with_suffix(".truth.csv"), path.with_suffix(".truth.tum")) if p.exists()]
    truth = read_trajectory(beside[0]) if beside else None
    return Recording(path.stem, camera, events, frames, frames_t_us, truth)


def _camera(path: Path, size_px, camera) -> Camera:
    beside = path.with_suffix(".camera.json")
    if camera is None and beside.exists():
        camera = beside
    if camera is None and size_px == DAVIS346_PX:
        warnings.warn(f"{path}: no calibration given; taking the nominal DAVIS 346", stacklevel=3)
        return Camera.davis346()
    if camera is None:
        size = f"{size_px[0]} x {size_px[1]} px" if size_px else "a file that does not state its size"
        raise InputError(f"{path}: no calibration for {size}; give one with --camera")
    name = "camera" if isinstance(camera, Camera) else camera
    camera = camera if isinstance(camera, Camera) else Camera.load(camera)
    if size_px is not None and camera.size_px != size_px:
        raise InputError(
            f"{path}: recorded at {size_px[0]} x {size_px[1]} px, but {name} is for "
            f"{camera.width_px} x {camera.height_px} px; give the calibration of this camera"
        )
    return camera


def _fault(events, frames, frames_t_us, size_px) -> str | None:
    """What makes these arrays no recording, and the remedy; None when nothing does."""
    if not len(events) and not len(frames):
        return "holds neither events nor frames; record again"
    if len(frames) != len(frames_t_us) or frames.shape[1:] != (size_px[1], size_px[0], 3):
        return f"frames of shape {frames.shape} for {len(frames_t_us)} times and {size_px} px; write it again"
    for what, t_us in (("events", events["t_us"]), ("frames", frames_t_us)):
        back = np.flatnonzero(t_us[1:] < t_us[:-1])
        if len(back):
            return (
                f"time of the {what} runs backward {len(back)} times, first after number {back[0]}; "
                "sort by time, or cut the recording there"
            )
    outside = ~_inside(events, size_px)
    if outside.any():
        k = np.flatnonzero(outside)[0]
        return (
            f"{outside.sum()} events outside {size_px[0]} x {size_px[1]} px, first number {k} at "
            f"({events['x'][k]}, {events['y'][k]}); check the sensor's size and the order of x and y"
        )
    return None


def _inside(events, size_px) -> np.ndarray:
    x, y = events["x"], events["y"]
    return (x >= 0) & (x < size_px[0]) & (y >= 0) & (y < size_px[1])


def _read_npz(path: Path):
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as data:
            events, frames, t_us = data["events"], data["frames"], data["frames_t_us"]
            width, height = (int(n) for n in data["size_px"])
        if events.dtype != EVENT or frames.dtype != np.uint8 or t_us.dtype != np.int64:
            raise ValueError(f"types {events.dtype}, {frames.dtype}, {t_us.dtype}")
        if (events.ndim, frames.ndim, t_us.ndim) != (1, 4, 1):
            raise ValueError(f"shapes {events.shape}, {frames.shape}, {t_us.shape}")
    except Exception as error:  # numpy, zipfile and tokenize raise a dozen types on damaged bytes
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise InputError(f"{path}: not a recording of ours ({reason}); write it with write_npz") from None
    return events, frames, t_us, (width, height)


def write_aedat4(recording: Recording, path) -> None:
    """Write AEDAT4 (Zstandard), the camera and the truth beside it; raises `InputError`."""
    write_recording(recording, path, (".aedat4",))


def write_npz(recording: Recording, path) -> None:
    """Write a compressed npz, the camera and the truth beside it; raises `InputError`."""
    write_recording(recording, path, (".npz",))


def write_recording(recording: Recording, path, suffixes=None) -> None:
    """Write in the format that the name ends in, the camera and the truth beside it; raises `InputError`."""
    path, r = Path(path), recording
    suffixes = suffixes or tuple(WRITERS)
    if path.suffix not in suffixes:
        raise InputError(
            f"{path}: cannot write '{path.suffix}'; expected a name that ends in {', '.join(suffixes)}"
        )
    if fault := _fault(r.events, r.frames, r.frames_t_us, r.camera.size_px):
        raise ValueError(f"recording: {fault}")
    with atomic(path.with_suffix(".camera.json")) as temporary:
        r.camera.save(temporary)
    if r.truth is not None:
        write_trajectory(r.truth, path.with_suffix(".truth.csv"))
    with atomic(path) as temporary:
        WRITERS[path.suffix](r, temporary)
        if r.truth is None:  # one of another recording would be taken for this one's
            path.with_suffix(".truth.csv").unlink(missing_ok=True)


def _save_npz(recording: Recording, path: Path) -> None:
    r = recording
    with path.open("wb") as file:
        np.savez_compressed(
            file, events=r.events, frames=r.frames, frames_t_us=r.frames_t_us, size_px=r.camera.size_px
        )


WRITERS = {
    ".aedat4": aedat4.write,
    ".bag": bags.write,
    ".h5": hdf5.write,
    ".hdf5": hdf5.write,
    ".npz": _save_npz,
}
FORMATS = (  # what it is, how its name ends, its reader
    ("AEDAT4 of iniVation's DV", (".aedat4",), aedat4.read),
    ("ROS 1 bag: dvs_msgs events, sensor_msgs images, raw or compressed", (".bag",), bags.read),
    ("HDF5 in the layouts of DSEC (ours too) and MVSEC", (".h5", ".hdf5"), hdf5.read),
    ("our arrays of numpy", (".npz",), _read_npz),
    ("events as text, t x y p", (".txt",), plain.read_text),
    ("images with timestamps.txt or images.txt", ("folder",), plain.read_folder),
    ("video", (".mp4", ".avi", ".mkv", ".mov"), plain.read_video),
)
READERS = {suffix: reader for _, suffixes, reader in FORMATS for suffix in suffixes}


def health(recording: Recording) -> dict:
    """What to know before using a recording: counts, rates, gaps, faults, and a window size.

    ``hot_pixels`` fire at least 20 times and 5 times as often as any neighbour: edges excite
    neighbours, defects don't.  ``suggested_window`` is the paper's N per pixel on this sensor.
    """
    e, (width, height) = recording.events, recording.camera.size_px
    t_us = e["t_us"] if len(e) else recording.frames_t_us
    duration_s = float(t_us.max() - t_us.min()) * 1e-6 if len(t_us) else 0.0
    steps = np.diff(e["t_us"])
    inside = e[_inside(e, (width, height))]
    index = inside["y"].astype(np.intp) * width + inside["x"]
    count = np.bincount(index, minlength=width * height).reshape(height, width)
    ring = np.ones((3, 3), bool)
    ring[1, 1] = False
    neighbours = maximum_filter(count, footprint=ring, mode="constant")
    window = max(1, round(PAPER.events_per_window * width * height / np.prod(DAVIS346_PX)))
    return {
        "events": len(e),
        "frames": len(recording.frames),
        "width_px": width,
        "height_px": height,
        "duration_s": duration_s,
        "event_rate_hz": len(e) / duration_s if duration_s else 0.0,
        "frame_rate_hz": _rate_hz(recording.frames_t_us),
        "on_fraction": float(e["p"].mean()) if len(e) else 0.0,
        "largest_gap_ms": float(steps.max(initial=0)) * 1e-3,
        "gaps_over_10_ms": int(np.sum(steps > 10_000)),
        "backward_steps": int(np.sum(steps < 0)),
        "out_of_range": len(e) - len(inside),
        "hot_pixels": int(np.sum((count >= 20) & (count > 5 * neighbours))),
        "suggested_window": window,
        "windows": len(e) // window,
        "truth": recording.truth is not None,
    }


def _rate_hz(t_us) -> float:
    return (len(t_us) - 1) * 1e6 / float(t_us[-1] - t_us[0]) if len(t_us) > 1 and t_us[-1] > t_us[0] else 0.0
