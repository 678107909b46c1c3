"""The clip of a paper port in a furnished room: what is done in it, at which image, and its camera."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from lmmap.types import Camera, Port, Pose

RATE_HZ = 15.0
CAMERA = Camera(640, 480, 600.0, 600.0, 322.0, 236.0, (-0.06, 0.0, 0.0, 0.0))
STILLS = 10  # images of a port that stands still
SLIDE_MM = np.repeat(np.arange(0, 101, 20), 3)  # along a ruler
LENGTHS = {"wave": 6, "slide": len(SLIDE_MM), "head-on": STILLS, "turned": STILLS, "cover": 6, "lamp": 6,
           "flat": STILLS}  # fmt: skip
PARTS = dict(
    zip(LENGTHS, map(slice, *np.cumsum([[0, *LENGTHS.values()][:-1], [*LENGTHS.values()]], 1)), strict=True)
)
COUNT = sum(LENGTHS.values())
TURNED_DEG = 45.0
WAVE_IMAGES = 60  # from a place and back to it; the clip has the first of them
FACING = Rotation.from_euler("x", 180, degrees=True)  # the port's z towards the camera, its x to the right


def part_of(image: int) -> str:
    """What is done in an image."""
    return next(name for name, part in PARTS.items() if part.start <= image < part.stop)


def pose(t: float) -> Pose:
    """T_cam_port at a time in images, also between two of a wave."""
    image = min(int(t), COUNT - 1)
    part = part_of(image)
    k = image - PARTS[part].start
    if part == "wave":
        s = 2 * np.pi * t / WAVE_IMAGES
        turn = Rotation.from_euler(
            "xyz", [22 * np.sin(2 * s), 30 * np.sin(s + 0.4), 15 * np.sin(s)], degrees=True
        )
        return _at(turn, [0.10 * np.sin(s), 0.05 * np.sin(2 * s + 1), 0.52 + 0.12 * np.cos(s)])
    tilt_deg = {"turned": TURNED_DEG, "head-on": 0.0, "flat": 30.0}.get(part, 20.0)
    x_m = -0.05 + 1e-3 * SLIDE_MM[k] if part == "slide" else 0.0
    return _at(Rotation.from_euler("y", tilt_deg, degrees=True), [x_m, 0.0, 0.6 if part != "cover" else 0.5])


def _at(turn: Rotation, position_m) -> Pose:
    return Pose((turn * FACING).as_matrix(), np.array(position_m))


def port_in(part: str) -> Port:
    """The port that was held: in the last part its plate lies in the plane of the ring."""
    port = Port.lm_map()
    return port if part != "flat" else flat(port)


def flat(port: Port) -> Port:
    """The port with its plate in the plane of the ring."""
    return replace(port, plate_height_m=0.0)
