"""Sensors by name: what a recording's size suggests, and nominal cameras on request.

A size says nothing about the lens.  `nominal` is for a first look at a recording without a calibration; its
ranges are as wrong as its focal length.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from lmmap.types import Camera, InputError


@dataclass(frozen=True)
class Sensor:
    """A sensor according to its maker's data sheet: number and pitch of its pixels."""

    maker: str
    cameras: str  # in which it is sold
    size_px: tuple[int, int]
    pitch_um: float


SENSORS = {
    "davis346": Sensor("iniVation", "DAVIS 346", (346, 260), 18.5),
    "davis240c": Sensor("iniVation", "DAVIS 240C", (240, 180), 18.5),
    "dvxplorer": Sensor("iniVation", "DVXplorer, DVXplorer Micro", (640, 480), 9.0),
    "dvxplorer-lite": Sensor("iniVation", "DVXplorer Lite", (320, 240), 18.0),
    "gen3": Sensor("Prophesee", "Gen3 VGA", (640, 480), 15.0),
    "gen4": Sensor("Prophesee", "Gen4 HD", (1280, 720), 4.86),
    "imx636": Sensor("Prophesee and Sony", "EVK3 HD, EVK3+, EVK4", (1280, 720), 4.86),
    "genx320": Sensor("Prophesee", "GenX320", (320, 320), 6.3),
}
ALIASES = {"evk3": "imx636", "evk3+": "imx636", "evk4": "imx636"}


def of_size(size_px: tuple[int, int]) -> str:
    """The cameras whose sensors have this size, as a text that may be empty."""
    return "; ".join(f"{s.maker}'s {s.cameras}" for s in SENSORS.values() if s.size_px == tuple(size_px))


def nominal(name: str, focal_mm: float) -> Camera:
    """The camera of a sensor behind a lens without distortion, centred on it; raises `InputError`."""
    key = ALIASES.get(name.lower(), name.lower())
    if key not in SENSORS or not 0.1 < focal_mm < 1000:
        known = ", ".join((*SENSORS, *ALIASES))
        raise InputError(f"{name}:{focal_mm:g}mm: no sensor and lens; give one of {known}, as evk4:8mm")
    sensor = SENSORS[key]
    (width, height), f_px = sensor.size_px, focal_mm * 1000 / sensor.pitch_um
    return Camera(width, height, f_px, f_px, (width - 1) / 2, (height - 1) / 2)


def lens(text: str) -> Camera | None:
    """The nominal camera of a text such as ``evk4:8mm``; None for other texts; raises `InputError`."""
    match = re.fullmatch(r"([\w+-]+):(\d+(?:\.\d+)?) ?([a-z]*)", text)
    if match and match[3] != "mm" and match[1].lower() in SENSORS | ALIASES:
        raise InputError(f"{text}: a focal length without mm; give {match[1]}:{match[2]}mm if it has so many")
    return nominal(match[1], float(match[2])) if match and match[3] == "mm" else None
