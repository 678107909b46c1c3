"""Cameras and ports as files: a dataclass's fields in JSON, or a calibration in YAML.

Both read everything with one error, `InputError`, that names the file, the problem and the remedy.  A file is
parsed only if it is short and flat, and each value is checked for its type and its range before it is used.
"""

from __future__ import annotations

import json
from dataclasses import MISSING, fields
from pathlib import Path

from .documents import check_fields, read_json, read_yaml, shown
from .files import InputError as InputError
from .files import atomic, read_text

MAX_BYTES = 2**20  # of a calibration; Kalibr's longest have some kilobytes

SIZE_PX = (int, 1, 32_767)  # an event's coordinates have 16 bits
FOCAL_PX = (float, 1.0, 1e6)  # a pixel sees 45 degrees, or a microradian
CENTRE_PX = (float, -1e6, 1e6)  # beyond the image, as in a crop
COEFFICIENT = (float, -1e3, 1e3)  # of a distortion; calibrations of wide lenses reach some tens
LENGTH_M = (float, 1e-6, 1e3)  # from a micrometre to a kilometre
OFFSET_M = (float, -1e3, 1e3)
CAMERA = {
    "width_px": SIZE_PX, "height_px": SIZE_PX, "fx_px": FOCAL_PX, "fy_px": FOCAL_PX,
    "cx_px": CENTRE_PX, "cy_px": CENTRE_PX, "distortion": (COEFFICIENT, (0, 4, 5)),
    "distortion_model": (str, "radtan", "equidistant"),
}  # fmt: skip
ROS_MODELS = {"plumb_bob": "radtan", "radtan": "radtan", "equidistant": "equidistant", "equi": "equidistant"}
PORT = {
    **dict.fromkeys(("ring_radius_m", "ring_inner_radius_m", "ring_outer_radius_m", "plate_circumradius_m",
                     "marker_radius_m", "stem_radius_m"), LENGTH_M),
    **dict.fromkeys(("plate_height_m", "petal_rise_m", "petal_lean_m", "panel_depth_m"), OFFSET_M),
    **dict.fromkeys(("marker_size_m", "petal_widths_m", "panel_size_m"), (LENGTH_M, (2,))),
    "symmetry": (int, 1, 360),  # markers a turn; at a degree each they are one ring
}  # fmt: skip


def read_camera(path, cls) -> dict:
    """Fields of a camera from our JSON, or from an OpenCV, ROS or Kalibr calibration YAML."""
    expected = "expected our JSON or a calibration YAML of OpenCV, ROS or Kalibr"
    return _read(path, cls, CAMERA, "camera calibration", expected, _yaml_camera)


def read_port(path, cls) -> dict:
    """Fields of a port from our JSON."""
    return _read(path, cls, PORT, "port", "expected a JSON object with the fields of lmmap.Port", None)


def write_fields(path, instance) -> None:
    """Write a dataclass as JSON."""
    values = {f.name: getattr(instance, f.name) for f in fields(instance)}
    with atomic(path) as temporary:
        temporary.write_text(json.dumps(values, indent=1) + "\n")


def _read(path, cls, schema: dict, what: str, expected: str, parse_yaml) -> dict:
    path = Path(path)
    text = read_text(path, MAX_BYTES)
    try:
        values = read_json(text) if path.suffix == ".json" or parse_yaml is None else parse_yaml(text)
        required = {f.name for f in fields(cls) if f.default is MISSING}
        values = check_fields(values, schema, required)
        cls(**values)  # what the class itself refuses is bad input too
        return values
    except ValueError as error:
        lines = str(error).strip().splitlines() or [""]
        raise InputError(f"{path}: not a {what} ({lines[0]:.200}); {expected}") from None


def _yaml_camera(text: str) -> dict:
    document = _mapping(read_yaml(text), "the document")
    if "cam0" in document:
        return _kalibr_camera(_mapping(document["cam0"], "cam0"))
    model = document.get("distortion_model", "plumb_bob")
    if not isinstance(model, str) or model not in ROS_MODELS:
        raise ValueError(f"distortion model {shown(model)} is none of {', '.join(ROS_MODELS)}")
    model = ROS_MODELS[model]
    k = _data(document, "camera_matrix")
    if len(k) != 9:
        raise ValueError(f"camera_matrix: expected 9 numbers, got {len(k)}")
    distortion = _data(document, "distortion_coefficients") if "distortion_coefficients" in document else []
    most = 4 if model == "equidistant" else 5
    if any(distortion[most:]):
        expected = "k1, k2, k3, k4" if model == "equidistant" else "k1, k2, p1, p2, k3"
        raise ValueError(f"{len(distortion)} distortion coefficients, expected {expected}")
    values = {name: _entry(document, key) for name, key in (("width_px", "image_width"),
                                                            ("height_px", "image_height"))}  # fmt: skip
    values |= dict(zip(("fx_px", "fy_px", "cx_px", "cy_px"), (k[0], k[4], k[2], k[5]), strict=True))
    return values | _lens(distortion[:most], model)


def _kalibr_camera(camera: dict) -> dict:
    """The first camera of a camchain."""
    model = _entry(camera, "camera_model"), camera.get("distortion_model", "none")
    if model[0] != "pinhole" or model[1] not in ("radtan", "equidistant", "equi", "none"):
        raise ValueError(
            f"camera model {model[0]!s:.20}-{model[1]!s:.20} is not pinhole-radtan or pinhole-equidistant"
        )
    size, intrinsics = _numbers(camera, "resolution", 2), _numbers(camera, "intrinsics", 4)
    names = "width_px", "height_px", "fx_px", "fy_px", "cx_px", "cy_px"
    values = dict(zip(names, (*size, *map(_float, intrinsics)), strict=True))
    coefficients = camera.get("distortion_coeffs") or []
    if not isinstance(coefficients, list):
        raise ValueError(f"distortion_coeffs: expected a list of numbers, got {shown(coefficients)}")
    return values | _lens([_float(c) for c in coefficients], ROS_MODELS.get(model[1], "radtan"))


def _lens(coefficients: list, model: str) -> dict:
    """The fields of a lens; a fisheye without coefficients still is one."""
    if model == "equidistant":
        return {"distortion": coefficients or [0.0] * 4, "distortion_model": model}
    return {"distortion": coefficients if any(coefficients) else []}


def _mapping(value, name: str) -> dict:
    if not isinstance(value, dict):
        raise ValueError(f"{name}: expected names with values, got {shown(value)}")
    return value


def _entry(document: dict, key: str):
    if key not in document:
        raise ValueError(f"missing {key}")
    return document[key]


def _data(document: dict, key: str) -> list:
    """The numbers of a matrix as OpenCV and ROS write it."""
    values = _entry(_mapping(_entry(document, key), key), "data")
    if not isinstance(values, list) or len(values) > 100:
        raise ValueError(f"{key}: expected a list of numbers, got {shown(values)}")
    return [_float(v) for v in values]


def _numbers(document: dict, key: str, count: int) -> list:
    values = _entry(document, key)
    if not isinstance(values, list) or len(values) != count:
        raise ValueError(f"{key}: expected {count} numbers, got {shown(values)}")
    return values


def _float(value):
    """Whole numbers and, as YAML reads 1e-3 for a text, texts as floats; all else as it is, to be refused."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return value
    try:
        return float(value)
    except (ValueError, OverflowError):
        return value
