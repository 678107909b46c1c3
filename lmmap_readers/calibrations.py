"""Calibrations as other programs write them.

A file has cameras by name: `cameras_in` finds them, `choose` picks one, `camera_fields` reads it.
"""

from __future__ import annotations

import re
import warnings
from pathlib import Path

from lmmap.camera_files import camera_of, odd
from lmmap.documents import once, read_json, shown
from lmmap.recordings.stream import Source
from lmmap.types import Camera

from .camera_fields import (
    EQUIDISTANT,
    MATRIX,
    RADTAN,
    camera_fields,
    mapping,
    number,
    region,
    region_text,
    stated_size,
    word,
)
from .documents import read_xml, read_yaml

COLMAP = {  # its models, and the parameters of each
    "SIMPLE_PINHOLE": "f cx cy", "PINHOLE": "fx fy cx cy", "SIMPLE_RADIAL": "f cx cy k1",
    "RADIAL": "f cx cy k1 k2", "OPENCV": "fx fy cx cy k1 k2 p1 p2",
    "SIMPLE_RADIAL_FISHEYE": "f cx cy k1", "RADIAL_FISHEYE": "f cx cy k1 k2",
    "OPENCV_FISHEYE": "fx fy cx cy k1 k2 k3 k4",
}  # fmt: skip


def read(text: str, path: Path, wanted: str, size_px=None, topics=()) -> dict:
    """Fields of `Camera` from a file's text: for the camera that is wanted or, if none is, for the one with
    the size and topic of a recording; a warning says so if that leaves a choice.  Raises ValueError."""
    document = _document(text, path.suffix)
    names = {word(key) for key in document} if isinstance(document, dict) else set()
    foreign = names & {*MATRIX, "cameras"} or any(re.fullmatch(r"cam\d+", name) for name in names)
    if path.suffix == ".json" and not foreign:
        return document  # ours, with another name in it
    cameras = cameras_in(document)
    if wanted and wanted not in cameras:
        raise ValueError(f"no camera {wanted!r:.30} among {', '.join(cameras):.100}")
    name, others = (wanted, []) if wanted else choose(cameras, size_px, topics)
    values = camera_fields(cameras[name], size_px)
    if part := region(cameras[name], size_px):
        warnings.warn(f"{path}: {region_text(*part)}", stacklevel=7)
    if others:
        other = f"not {', '.join(others):.100}; name another, as --camera {path.name}:{others[0]:.30}"
        warnings.warn(f"{path}: taking {name:.30}, {other}", stacklevel=7)
    return values


def inside(source: Source, cameras: dict[str, dict]) -> tuple[Camera | None, str]:
    """The camera that a recording itself describes, with a warning that says which; or why it is not used."""
    size_px = source.size_px
    try:
        name, others = choose(cameras, size_px, source.topics)
    except ValueError as error:
        return None, f"its own calibrations are not used ({error})"
    try:
        if after := cameras[name].get("changes"):
            raise ValueError(f"it changes {after} after the beginning: cut the bag there")
        camera = camera_of(camera_fields(cameras[name], size_px))
        if size_px not in (None, camera.size_px):
            raise ValueError(
                f"it is for {camera.width_px} x {camera.height_px} px, not {size_px[0]} x {size_px[1]}"
            )
    except ValueError as error:
        return None, f"its own calibration {name} is not used ({error})"
    part = region(cameras[name], size_px)
    notes = [region_text(*part)] if part else []
    notes += [f"not {', '.join(others)}"] if others else []
    doubt = f"; {reason}, check it" if (reason := odd(camera)) else ""
    warnings.warn(
        f"{source.path}: taking its own calibration {', '.join([name, *notes])}{doubt}", stacklevel=5
    )
    return camera, ""


def _document(text: str, suffix: str):
    """What a calibration's text holds: XML and YAML differ in their first letter; raises ValueError."""
    if suffix == ".txt":
        lines = [line.split() for line in text.splitlines() if line[:1] not in ("#", "")]
        return {"cameras": _cameras_of_lines(lines)}
    if suffix == ".json":
        return read_json(text)
    return (read_xml if text.lstrip()[:1] == "<" else read_yaml)(text)


def cameras_in(document) -> dict[str, dict]:
    """The cameras that a document describes, by name, in the document's own form; raises ValueError."""
    document = mapping(document, "the document")
    if "cameras" in document:  # dv-processing
        numbered = mapping(document["cameras"], "cameras")
    else:
        numbered = {n: c for n, c in document.items() if re.fullmatch(r"cam\d+", str(n))}  # Kalibr
    return {str(n): mapping(c, str(n)[:30]) for n, c in numbered.items()} or {"": document}


def _cameras_of_lines(lines: list[list[str]]) -> dict[str, dict]:
    """Cameras of COLMAP's ``cameras.txt``, or of RPG's ``calib.txt``: fx fy cx cy, then k1 k2 p1 p2 k3."""
    if lines and len(lines[0]) > 4 and lines[0][1].isupper():
        return once([(line[0], _colmap(line[1], line[2:4], line[4:])) for line in lines])
    numbers = [number(word) for line in lines for word in line]
    if len(numbers) not in (4, 8, 9) or any(isinstance(n, str) for n in numbers):
        raise ValueError("expected lines of COLMAP, or fx fy cx cy and none, four or five coefficients")
    return {"": {"intrinsics": numbers[:4], "D": numbers[4:]}}


def _colmap(model: str, size: list[str], numbers: list[str]) -> dict:
    if model not in COLMAP or len(numbers) != len(COLMAP[model].split()):
        known = ", ".join(COLMAP)
        raise ValueError(f"COLMAP's model {shown(model)} of {len(numbers)} numbers is none of {known}")
    p = dict(zip(COLMAP[model].split(), map(number, numbers), strict=True))
    f = [p.get(name, p.get("f")) for name in ("fx", "fy")]
    # COLMAP counts from a pixel's corner, we from its centre
    centre = [c - 0.5 if isinstance(c, float) else c for c in (p["cx"], p["cy"])]
    lens = EQUIDISTANT if "FISHEYE" in model else RADTAN
    order = ("k1", "k2", "k3", "k4") if lens == EQUIDISTANT else ("k1", "k2", "p1", "p2")
    return {"resolution": size, "intrinsics": [*f, *centre], "D": [p.get(name, 0.0) for name in order],
            "distortion_model": lens}  # fmt: skip


def choose(cameras: dict[str, dict], size_px=None, topics=()) -> tuple[str, list[str]]:
    """The name of the camera that matches a recording's size and topics, and those of others that match."""
    sizes = {n: (None, stated_size(c), (region(c, size_px) or ())[2:4]) for n, c in cameras.items()}
    fitting = [n for n in cameras if size_px is None or sizes[n][1] is None or (*size_px,) in sizes[n]]
    fitting = fitting or list(cameras)
    topic = {n: str(cameras[n].get("rostopic", cameras[n].get("name", ""))) for n in fitting}
    places = {place for t in topics if (place := t.rpartition("/")[0])}
    same = [n for n in fitting if topic[n] in topics]
    first, *others = same or [n for n in fitting if topic[n].rpartition("/")[0] in places] or fitting
    return first, others
