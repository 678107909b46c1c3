"""Convert the names and values that other programs give a camera and its lens to fields of `Camera`."""

from __future__ import annotations

import re

from lmmap.camera_files import NAMES
from lmmap.documents import once, shown

# keys in small letters without _, of: Kalibr, dv-processing, M3ED; Metavision
SIZE = ("resolution", "imagesize", "imgsize")
SIDES = (("imagewidth", "imageheight"), ("width", "height"), ("nu", "nv"))  # OpenCV, ROS; CameraInfo; SPEED+
MATRIX = ("cameramatrix", "intrinsics", "k")  # OpenCV, ROS, SPEED+; Kalibr, M3ED; CameraInfo
COEFFICIENTS = ("distortioncoefficients", "distortioncoeffs", "d", "distcoeffs", "distortion")
RADTAN, EQUIDISTANT = "radtan", "equidistant"
LENSES = {  # by the key that names a lens: what its values are to us; None: nothing of distortion
    "fisheyemodel": {"0": RADTAN, "1": EQUIDISTANT},  # OpenCV's sample
    "distortionmodel": {  # ROS, Kalibr, M3ED, dv-processing
        **dict.fromkeys(("plumbbob", "rationalpolynomial", "radtan", "radialtangential"), RADTAN),
        **dict.fromkeys(("equidistant", "equi", "fisheye", "kannalabrandt", "kannalabrandt4"), EQUIDISTANT),
        **dict.fromkeys(("none", ""), "none"),
    },
    "cameramodel": {"pinhole": None},  # Kalibr, M3ED
    "type": {"pinhole": None, "fisheye": EQUIDISTANT, "kannalabrandt": EQUIDISTANT},  # Metavision
    "unit": dict.fromkeys(("px", "pixel", "pixels")),
}
NAMES_A_LENS = re.compile(
    r"model|unit|fisheye|omni|lens|mirror|distort|(?<!re)projection(?!matrix)|^type$|^xi$|^[kp]\d$|^coeff|crop"
)


def camera_fields(camera: dict, size_px=None) -> dict:
    """Fields of `Camera`; the recording's ``size_px`` serves a file that states none.  Raises ValueError."""
    model, camera = _lens(camera), _plain(camera)
    width_px, height_px = stated_size(camera) or size_px or (None, None)
    if width_px is None:
        raise ValueError("missing image_width and image_height, and no recording states them either")
    names = ("focallength", "principalpoint") if "focallength" in camera else (MATRIX,)  # dv-processing
    matrix = [n for name in names for n in _list(camera, name, "camera_matrix")]
    coefficients = _list(camera, COEFFICIENTS)
    expected = {EQUIDISTANT: "k1, k2, k3, k4", "none": ""}.get(model, "k1, k2, p1, p2, k3")
    most = len(expected.split())
    if not all(map(_is_zero, coefficients[most:])):
        raise ValueError(f"{len(coefficients)} distortion coefficients, expected {expected or 'none'}")
    values = {"width_px": width_px, "height_px": height_px} | dict(zip(NAMES, _pinhole(matrix), strict=True))
    if part := region(camera, size_px):
        values = _of_region(values, *part)
    if model == EQUIDISTANT:  # a fisheye without coefficients still is one
        return values | {"distortion": coefficients[:most] or [0.0] * 4, "distortion_model": model}
    return values | {"distortion": [] if all(map(_is_zero, coefficients)) else coefficients[:most]}


def region(camera: dict, size_px=None) -> tuple | None:
    """The part of the sensor that images of a size show: x, y, width and height, and how many columns and
    rows are binned to one; None if it is the whole sensor.  A CameraInfo's numbers refer to the whole sensor,
    even if its width and height are the region's; zeros stand for all of it.  Raises ValueError."""
    camera = _plain(camera)
    roi, stated = _plain(mapping(camera.get("roi") or {}, "roi")), stated_size(camera)
    keys = ("xoffset", "yoffset", "width", "height")
    numbers = [_whole(v or 0) for v in (*map(roi.get, keys), *map(camera.get, ("binningx", "binningy")))]
    if not all(isinstance(n, int) and 0 <= n < 2**15 for n in numbers):
        raise ValueError("roi and binning: expected whole numbers of pixels")
    x, y, *region_px, columns, rows = numbers
    if stated is None or not any((x, y, *region_px, columns > 1, rows > 1)):
        return None
    step = max(columns, 1), max(rows, 1)
    seen_px = tuple((r or s) // n for r, s, n in zip(region_px, stated, step, strict=True))
    whole = size_px and (*size_px,) != seen_px  # a region that these images do not know
    return None if whole or (x, y, *step, seen_px) == (0, 0, 1, 1, stated) else (x, y, *seen_px, *step)


def region_text(x: int, y: int, width_px: int, height_px: int, columns: int, rows: int) -> str:
    """A region of interest in words."""
    binned = f", {columns} x {rows} pixels binned to one" if columns * rows > 1 else ""
    return f"of its region of interest at ({x}, {y}), {width_px} x {height_px} px{binned}"


def _of_region(values: dict, x: int, y: int, width_px: int, height_px: int, columns: int, rows: int) -> dict:
    """Fields of the whole sensor as those of a region, binned; the centre of n pixels lies between them."""
    fx, fy, cx, cy = (values[name] for name in NAMES)
    if not all(isinstance(v, float) for v in (fx, fy, cx, cy)):
        return values  # and refused for that
    numbers = fx / columns, fy / rows, (cx - x + 0.5) / columns - 0.5, (cy - y + 0.5) / rows - 0.5
    return {"width_px": width_px, "height_px": height_px} | dict(zip(NAMES, numbers, strict=True))


def _lens(camera: dict) -> str | None:
    """What the keys that name a lens say; ValueError at one that is unknown, or where they differ."""
    found = set()
    for key, value in camera.items():
        key = str(key)
        name = word(int(value) if isinstance(value, bool) else value)
        known = LENSES.get(word(key).removesuffix("s"))
        if known is None:
            if NAMES_A_LENS.search(word(key)) and word(key) not in COEFFICIENTS:
                raise ValueError(f"unknown {key:.30}, which may change what the numbers mean")
        elif name not in known:
            raise ValueError(f"{key} {shown(value)} is none of {', '.join(filter(None, known))}")
        elif known[name]:
            found.add(known[name])
    if len(found) > 1:
        raise ValueError(f"its keys name two lenses, {' and '.join(sorted(found))}")
    return next(iter(found), None)


def word(value) -> str:
    return str(value).lower().replace("_", "")


def _plain(camera: dict) -> dict:
    return once([(word(key), value) for key, value in camera.items()])


def _pinhole(matrix: list) -> list:
    """fx, fy, cx, cy of these four, or of a matrix of nine by rows; ValueError if it is neither."""
    if len(matrix) == 4:
        return matrix
    if len(matrix) != 9:
        raise ValueError(f"camera_matrix: expected 9 numbers, got {len(matrix)}")
    fx, skew, cx, below, fy, cy, *last = matrix
    if all(isinstance(v, float) for v in matrix):  # others are refused for that
        if not any(matrix):
            raise ValueError("camera_matrix: all zero, as of a camera that was not calibrated")
        if last != [0, 0, 1]:
            turned = "; it is transposed" if (cx, cy) == (0, 0) and any(last[:2]) else ""
            raise ValueError(f"camera_matrix: last row {last}, expected [0, 0, 1]{turned}")
        if below or abs(skew) > 1e-3 * abs(fx):
            raise ValueError(f"camera_matrix: expected no skew, got {skew or below:g}")
    return [fx, fy, cx, cy]


def stated_size(camera: dict) -> tuple | None:
    """Width and height (px) if a camera states them, else None; raises ValueError."""
    camera = _plain(camera)
    value = next((camera[key] for key in SIZE if key in camera), None)
    camera = _plain(value) if isinstance(value, dict) else camera
    if isinstance(value, list) and len(value) == 2:
        return tuple(map(_whole, value))
    if value is not None and not isinstance(value, dict):
        raise ValueError(f"resolution: expected 2 numbers, got {shown(value)}")
    sides = next((pair for pair in SIDES if {*pair} & {*camera}), None)
    if sides and (missing := {*sides} - {*camera}):
        raise ValueError(f"missing {missing.pop().replace('image', 'image_')}")
    return tuple(_whole(camera[side]) for side in sides) if sides else None


def mapping(value, name: str) -> dict:
    """The value, if it is a dict; raises a ValueError with ``name`` otherwise."""
    if not isinstance(value, dict):
        raise ValueError(f"{name}: expected names with values, got {shown(value)}")
    return value


def _list(camera: dict, keys, needed: str | None = None) -> list:
    """Numbers of a list, of lists by rows, or of a matrix as OpenCV and ROS write it; none of nothing."""
    found = [key for key in ([keys] if isinstance(keys, str) else keys) if key in camera]
    if not found:
        if needed:
            raise ValueError(f"missing {needed}")
        return []
    lists = [_numbers(key, camera[key]) for key in found]
    if any(numbers != lists[0] for numbers in lists):
        raise ValueError(f"{' and '.join(found)} differ")
    return lists[0]


def _numbers(key: str, value) -> list:
    stated = None
    if isinstance(value, dict):
        stated, value = [_whole(value.get(side)) for side in ("rows", "cols")], value.get("data")
    if value == "" or (value is None and 0 in (stated or ())):  # as OpenCV writes what is empty
        return []
    if not isinstance(value, list) or len(value) > 100:
        raise ValueError(f"{key}: expected a list of numbers, got {shown(value)}")
    numbers = [number(v) for row in value for v in (row if isinstance(row, list) else [row])]
    if stated and all(isinstance(n, int) for n in stated) and stated[0] * stated[1] != len(numbers):
        raise ValueError(f"{key}: expected {stated[0] * stated[1]} numbers, got {len(numbers)}")
    return numbers


def _is_zero(value) -> bool:
    return isinstance(value, float) and value == 0


def number(value):
    """Convert numbers and texts (YAML reads 1e-3 as a text) to floats; return all else as it is, to be
    refused."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return value
    try:
        return float(value)
    except (ValueError, OverflowError):
        return value


def _whole(value):
    if isinstance(value, float) and value.is_integer():
        return int(value)
    return int(value) if isinstance(value, str) and value.isdecimal() and len(value) < 10 else value
