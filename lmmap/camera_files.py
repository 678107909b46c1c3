"""Cameras and ports as files: a dataclass's fields in JSON.

Both readers raise a single error, `InputError`, which names the file, the problem and the remedy.  A file is
parsed only if it is short and flat, and the type and range of each value are checked before it is used.
"""

from __future__ import annotations

import json
import os
import warnings
from contextlib import suppress
from dataclasses import MISSING, fields
from pathlib import Path

from . import plugins
from .documents import check_fields, read_json
from .errors import InputError
from .files import read_text, write_text
from .types import Camera, Port
from .types.port import OFFSET_M, SYMMETRY, TOLERANCE, TOLERANCES, WINDOW_M

NAMES = "fx_px", "fy_px", "cx_px", "cy_px"
MAX_BYTES = 2**20  # of a calibration; Kalibr's longest have some kilobytes

SIZE_PX = (int, 1, 32_767)  # an event's coordinates have 16 bits
FOCAL_PX = (float, 1.0, 1e6)  # a pixel sees 45 degrees, or a microradian
CENTRE_PX = (float, -1e6, 1e6)  # beyond the image, as in a crop
COEFFICIENT = (float, -1e3, 1e3)  # of a distortion; calibrations of wide lenses reach some tens
LENGTH_M = (float, 1e-6, 1e3)  # from a micrometre to a kilometre
CAMERA = {
    "width_px": SIZE_PX, "height_px": SIZE_PX, "fx_px": FOCAL_PX, "fy_px": FOCAL_PX,
    "cx_px": CENTRE_PX, "cy_px": CENTRE_PX, "distortion": (COEFFICIENT, (0, 4, 5)),
    "distortion_model": (str, "radtan", "equidistant"),
}  # fmt: skip
PORT = {
    **dict.fromkeys(("ring_radius_m", "ring_inner_radius_m", "ring_outer_radius_m", "plate_circumradius_m",
                     "marker_radius_m", "stem_radius_m"), LENGTH_M),
    **dict.fromkeys(("plate_height_m", "petal_rise_m", "petal_lean_m", "panel_depth_m"), (float, *OFFSET_M)),
    **dict.fromkeys(("marker_size_m", "petal_widths_m", "panel_size_m"), (LENGTH_M, (2,))),
    "window_radius_m": (float, *WINDOW_M), "window_size_m": ((float, *WINDOW_M), (2,)),
    **dict.fromkeys(TOLERANCES, (float, *TOLERANCE)), "symmetry": (int, *SYMMETRY),
}  # fmt: skip


def read_camera(path, size_px=None, topics=()) -> Camera:
    """Read a camera from our JSON or, if lmmap_readers is installed, from another program's calibration.

    If a file holds several cameras, take the one that ``FILE:NAME`` names, or that matches a recording's
    ``size_px`` (width, height) and topics; a warning says so if that leaves a choice.  Raises `InputError`.
    """
    path, wanted = split_name(path)
    expected = "expected our JSON, or a calibration of OpenCV, ROS, Kalibr, DV, Metavision or COLMAP"

    def parse(text: str) -> dict:
        if path.suffix == ".json" or text.lstrip()[:1] == "{":
            with suppress(ValueError):
                values = read_json(text)
                if isinstance(values, dict) and "fx_px" in values:
                    return values
        foreign = plugins.reader("calibration")
        return foreign(text, path, wanted, size_px, topics) if foreign else read_json(text)

    camera = _read(path, Camera, CAMERA, "camera calibration", expected, parse)
    if reason := odd(camera):
        warnings.warn(f"{path}: {reason}; check the calibration", stacklevel=5)
    return camera


def camera_of(values: dict) -> Camera:
    """The camera stored in a recording, checked like one from a file; raises ValueError."""
    return _checked(values, Camera, CAMERA)


def odd(camera: Camera) -> str | None:
    """Say what is implausible about a camera (centre, focal length or pixel shape); None if nothing is."""
    width, height, fx, fy, cx, cy = (getattr(camera, n) for n in ("width_px", "height_px", *NAMES))
    if abs(cx - (width - 1) / 2) > width / 5 or abs(cy - (height - 1) / 2) > height / 5:
        return f"its centre ({cx:g}, {cy:g}) is far from the middle of {width} x {height} px"
    if not 0.2 < fx / width < 50:
        return f"its focal length is {fx:g} px for {width} px"
    return None if 0.8 < fx / fy < 1.25 else f"its focal lengths differ, {fx:g} and {fy:g} px"


def split_name(path) -> tuple[Path, str]:
    """Split ``FILE:NAME`` into file and camera; the name is empty for ``FILE`` alone.

    Raises
    ------
    InputError
        If there is a colon but no name.
    """
    file, _, name = str(path).rpartition(":")
    if not os.path.exists(file) or os.path.exists(path):
        return Path(path), ""
    if not name:
        raise InputError(f"{path}: expected FILE:NAME, got no name; add a camera's, or leave the colon out")
    return Path(file), name


def read_port(path) -> Port:
    """Read a port from our JSON; raises `InputError`."""
    return _read(path, Port, PORT, "port", "expected a JSON object with the fields of lmmap.Port", read_json)


def write_fields(path, instance: Camera | Port) -> None:
    """Write a camera or port as JSON; raises `InputError` if it could not be read again."""
    values = {f.name: getattr(instance, f.name) for f in fields(instance)}
    try:
        _checked(values, type(instance), CAMERA if isinstance(instance, Camera) else PORT)
    except ValueError as error:
        raise InputError(
            f"{path}: not written, since it could not be read again ({error}); correct that value"
        ) from None
    write_text(path, json.dumps(values, indent=1) + "\n")


def _read(path, cls, schema: dict, what: str, expected: str, parse):
    path = Path(path)
    text = read_text(path, MAX_BYTES)
    try:
        return _checked(parse(text), cls, schema)
    except ValueError as error:
        lines = str(error).strip().splitlines() or [""]
        raise InputError(f"{path}: not a {what} ({lines[0]:.200}); {expected}") from None


def _checked(values: dict, cls, schema: dict):
    required = {f.name for f in fields(cls) if f.default is MISSING}
    return cls(**check_fields(values, schema, required))
