"""Open files as recordings: the formats of the paper's laboratory here, others by readers from `plugins`.

``open_recording`` turns a file into a checked `Recording`; no later code has to check again
whether time runs forward or coordinates lie on the sensor.  Beside a recording ``NAME.aedat4`` lie
``NAME.camera.json`` (the calibration) and, if it is known, ``NAME.truth.csv`` or ``.truth.tum``.
A folder of bags may share one ``camera.json``.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import cast

from .. import plugins
from ..files import CAMERA, beside, regular_file
from ..types import Camera, InputError, Recording, checked
from . import aedat4, hdf5, images, rosbag
from .limits import check_times
from .pose_files import read_truth
from .stream import Source, Stream, input_errors

UNITS = ("s", "ms", "us", "ns")
METADATA = "metadata.yaml"  # what tells a ROS 2 bag's folder from another


@checked
def open_recording(path: str | Path, camera: Camera | str | Path | None = None, **options) -> Recording:
    """Read any of `formats` into memory, with the camera and truth beside it; raises `InputError`.

    ``camera`` (or a calibration file, or a sensor and its nominal lens, such as ``"evk4:8mm"``) takes
    precedence over ``NAME.camera.json``, and that over a calibration inside the recording.  Without any, a
    recording of 346 x 260 px gets the nominal DAVIS 346 camera, with a warning.  ``options`` are those of
    `open_stream`.

    Examples
    --------
    >>> recording = lmmap.open_recording(DATA / "mini" / "test-low.aedat4")
    >>> recording.frames.shape[1:], recording.truth is None
    ((260, 346, 3), False)
    """
    return open_stream(path, camera, **options).collect()


def open_stream(
    path,
    camera: Camera | str | Path | None = None,
    *,
    checked: bool = True,
    fps: float | None = None,
    stream: int | str | None = None,
    time_unit: str | None = None,
) -> Stream:
    """As `open_recording`, but read the file while it is used, in bounded memory however long the recording.

    Faults in the data raise `InputError` when they are reached.  With ``checked=False`` they do not, and a
    recording without a calibration is accepted: its stream has no camera.

    Parameters
    ----------
    fps
        Pictures per second in a folder of pictures without times.
    stream
        Which camera to read, of several: the number of a stream in AEDAT4, or a group in HDF5.
    time_unit
        Unit of the times (s, ms, us or ns) in files that do not state it.

    Raises
    ------
    InputError
        If the file cannot be read, or an option does not apply to its format.
    ValueError
        If ``time_unit`` is none of these.
    """
    if time_unit not in (None, *UNITS):
        raise ValueError(f"time_unit: expected one of {', '.join(UNITS)}, got {time_unit!r:.40}")
    named = {"fps": fps, "stream": stream, "time_unit": time_unit}
    path = Path(path)
    if not os.path.isdir(path):
        regular_file(path)
    kind = _kind(path)
    if kind not in READERS and not plugins.reader(kind):
        raise InputError(f"{path}: cannot read '{path.suffix}'; give one of {', '.join(suffixes())}")
    options = {name: value for name, value in named.items() if value is not None}
    for name, value in options.items():
        if kind not in OPTIONS[name][0]:
            flag = f"--{name.replace('_', '-')} {value}"
            raise InputError(f"{path}: {flag} is for {OPTIONS[name][1]}; leave it out")
    if {"fps", "time_unit"} <= options.keys():
        raise InputError(f"{path}: --fps makes the times, so they have no --time-unit; leave one out")
    read = READERS.get(kind)
    source = read(path, **options) if read else None
    if source is None:  # of another layout than ours
        source = plugins.needed(kind, path)(path, **options)
    if source.span_us:
        with input_errors(path, "damaged", "copy it again"):
            for t_us in source.span_us:
                check_times(t_us)
    camera = _camera(path, source, camera, needed=checked)
    if source.guessed and (doubt := source.guessed.doubt(camera.size_px if camera else source.size_px)):
        taken = f"its times are taken as {source.guessed.unit}"
        warnings.warn(f"{path}: {taken}; {doubt}", stacklevel=3)
    truths = [
        p for p in (path.with_suffix(".truth.csv"), path.with_suffix(".truth.tum")) if os.path.exists(p)
    ]
    truth = read_truth(truths[0]) if truths else None
    return Stream(path.stem, cast(Camera, camera), source, truth, checked)


def suffixes() -> list[str]:
    """Suffixes of the recordings that can be read; "folder" stands for a folder of pictures."""
    found = plugins.entry_points(plugins.READERS)
    return [*READERS, *(name for name in found if name[0] == "." and name not in READERS)]


def formats() -> dict[str, tuple[str, ...]]:
    """Suffixes of each format, by the format's description."""
    what = {suffix: text for text, ends, _ in FORMATS for suffix in ends}
    others = [suffix for suffix in reversed(suffixes()) if suffix not in what]
    what |= {suffix: plugins.reader(suffix).what for suffix in others}
    return {text: tuple(s for s in what if what[s] == text) for text in dict.fromkeys(what.values())}


def format_name(path) -> str:
    """The description in `formats` of the format of a file or folder that can be read."""
    return next(what for what, ends in formats().items() if _kind(Path(path)) in ends)


def load_camera(text, size_px: tuple[int, int] | None = None, topics=()) -> Camera:
    """Load the camera of a calibration file (if it holds several, the one that matches a recording's size and
    topics), or the nominal one of a text such as ``evk4:8mm``; raises `InputError`."""
    nominal = None if Path(str(text)).exists() else plugins.reader("lens")
    return (nominal and nominal(str(text))) or Camera.load(text, size_px, topics)


def _kind(path: Path) -> str:
    """How the name of a file ends, of a ROS 2 bag's folder as that of its files."""
    if os.path.isdir(path):
        return ".db3" if (path / METADATA).exists() else "folder"
    return path.suffix.lower()


def _camera(path: Path, source: Source, camera, needed: bool) -> Camera | None:
    own, size_px, doubt = path.with_suffix(".camera.json"), source.size_px, ""
    if camera is None:
        camera = own if os.path.exists(own) else beside(path, CAMERA) if path.suffix == ".bag" else None
    if camera is None and (cameras := source.cameras()) and (choose := plugins.reader("cameras")):
        camera, doubt = choose(source, cameras)
    if camera is None and size_px == Camera.davis346().size_px:
        text = f"{path}: {doubt or 'no calibration given'}; taking the nominal DAVIS 346"
        warnings.warn(text, stacklevel=4)
        return Camera.davis346()
    if camera is None and not needed:
        if doubt:
            warnings.warn(f"{path}: {doubt}", stacklevel=4)
        return None
    if camera is None:
        size = f"{size_px[0]} x {size_px[1]} px" if size_px else "a file that does not state its size"
        if size_px and (of_size := plugins.reader("sensors")) and (cameras := of_size(size_px)):
            size += f" (as of {cameras})"
        raise InputError(f"{path}: {doubt or f'no calibration for {size}'}; give one with --camera")
    name = "camera" if isinstance(camera, Camera) else camera
    camera = camera if isinstance(camera, Camera) else load_camera(camera, size_px, source.topics)
    if size_px is not None and camera.size_px != size_px:
        deg = source.details().get(images.TURNED)
        turned = f", turned by {deg} degrees as its metadata ask" if deg else ""
        raise InputError(
            f"{path}: recorded at {size_px[0]} x {size_px[1]} px{turned}, but {name} is for "
            f"{camera.width_px} x {camera.height_px} px; give the calibration of this camera"
        )
    return camera


FORMATS = (  # what it is, how its name ends, its reader
    ("AEDAT4 of iniVation's DV", (".aedat4", ".aedat"), aedat4.read),
    ("ROS 1 bag: dvs_msgs or event_camera_msgs events, sensor_msgs images", (".bag",), rosbag.read),
    ("HDF5 in the layouts of DSEC (ours too), M3ED, MVSEC and Prophesee", (".h5", ".hdf5"), hdf5.read),
    ("images with timestamps.txt or images.txt", ("folder",), images.read_numbered),
    ("one picture", images.IMAGE_SUFFIXES, images.read_picture),
    ("video", (".mp4", ".avi", ".mkv", ".mov"), images.read_video),
)
READERS: dict[str, Callable] = {suffix: reader for _, suffixes, reader in FORMATS for suffix in suffixes}
OPTIONS = {  # of `open_stream`: the suffixes that each is for, and what these are
    "fps": (("folder",), "a folder of pictures"),
    "stream": ((".aedat4", ".aedat", ".h5", ".hdf5"), "AEDAT4 or HDF5 of several cameras"),
    "time_unit": (
        (".txt", ".csv", ".npy", ".h5", ".hdf5", "folder"),
        "events as text, CSV, npy or HDF5, or a folder's list of times",
    ),
}
