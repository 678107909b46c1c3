"""Cameras and ports as files: a dataclass's fields in JSON, or a calibration in YAML.

Both read everything with one error, `InputError`, that names the file, the problem and the remedy.
"""

from __future__ import annotations

import json
import re
from dataclasses import MISSING, fields
from pathlib import Path

import numpy as np
import yaml


class InputError(Exception):
    """Bad input from outside: the message names the file, the problem and the remedy."""


def read_camera(path, cls) -> dict:
    """Fields of a camera from our JSON, or from an OpenCV, ROS or Kalibr calibration YAML."""
    expected = "expected our JSON or a calibration YAML of OpenCV, ROS or Kalibr"
    return _read(path, cls, "camera calibration", expected, _yaml_camera)


def read_port(path, cls) -> dict:
    """Fields of a port from our JSON."""
    return _read(path, cls, "port", "expected a JSON object with the fields of lmmap.Port", None)


def write_fields(path, instance) -> None:
    """Write a dataclass as JSON."""
    values = {f.name: getattr(instance, f.name) for f in fields(instance)}
    Path(path).write_text(json.dumps(values, indent=1) + "\n")


def _read(path, cls, what: str, expected: str, otherwise) -> dict:
    path = Path(path)
    try:
        text = path.read_text()
        values = _json(text, cls) if path.suffix == ".json" or otherwise is None else otherwise(text)
        cls(**values)  # what the class itself refuses is bad input too
        return values
    except (OSError, ValueError, KeyError, TypeError, AttributeError, yaml.YAMLError) as error:
        lines = str(error).strip().splitlines() or [""]
        raise InputError(f"{path}: not a {what} ({type(error).__name__}: {lines[0]}); {expected}") from None


def _json(text: str, cls) -> dict:
    values = json.loads(text)
    if not isinstance(values, dict):
        raise ValueError("expected an object")
    needed = {f.name for f in fields(cls) if f.default is MISSING}
    if missing := sorted(needed - set(values)):
        raise ValueError(f"missing {', '.join(missing)}")
    return {k: tuple(v) if isinstance(v, list) else v for k, v in values.items()}


def _yaml_camera(text: str) -> dict:
    # OpenCV writes '%YAML:1.0' and '!!opencv-matrix', which no YAML parser knows
    text = re.sub(r"^%YAML.*\n(---\n)?", "", text).replace("!!opencv-matrix", "")
    y = yaml.safe_load(text)
    if "cam0" in y:
        return _kalibr_camera(y["cam0"])
    if y.get("distortion_model", "plumb_bob") not in ("plumb_bob", "radtan"):
        raise ValueError(f"distortion model {y['distortion_model']} is not radial-tangential")
    k = np.array(y["camera_matrix"]["data"], float).reshape(3, 3)
    distortion = y.get("distortion_coefficients", {}).get("data", [])
    if np.any(distortion[5:]):
        raise ValueError(f"{len(distortion)} distortion coefficients, expected k1, k2, p1, p2, k3")
    return dict(
        width_px=int(y["image_width"]),
        height_px=int(y["image_height"]),
        fx_px=float(k[0, 0]),
        fy_px=float(k[1, 1]),
        cx_px=float(k[0, 2]),
        cy_px=float(k[1, 2]),
        distortion=tuple(float(d) for d in distortion[:5]) if np.any(distortion) else (),
    )


def _kalibr_camera(cam: dict) -> dict:
    """The first camera of a camchain."""
    model = cam["camera_model"], cam.get("distortion_model", "none")
    if model not in (("pinhole", "radtan"), ("pinhole", "none")):
        raise ValueError(f"camera model {'-'.join(model)} is not pinhole-radtan")
    width, height = (int(n) for n in cam["resolution"])
    names = "width_px", "height_px", "fx_px", "fy_px", "cx_px", "cy_px"
    values = dict(zip(names, (width, height, *map(float, cam["intrinsics"])), strict=True))
    return values | {"distortion": tuple(float(d) for d in cam.get("distortion_coeffs", ()))}
