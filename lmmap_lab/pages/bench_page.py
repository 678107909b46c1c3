"""The plan of the laboratory and what one pixel of its event sensor sees, of the chapter on the bench."""

from __future__ import annotations

import numpy as np

from lmmap.types import Camera, Port

from ..bench import sequences
from ..bench.event_sensor import EventSensor, SensorSettings
from ..bench.laboratory import COLOCATED_M, EARTHSHINE_M, SUN_M, Sequence
from .drawings import COLOUR

LAMPS = {
    "sun": (SUN_M, "rival"),
    "earthshine": (EARTHSHINE_M, "rgb"),
    "lamp beside the camera": (COLOCATED_M, "event"),
}


def draw_plan(ax, port: Port, camera: Camera, distance_m: float = 0.6) -> None:
    """The laboratory from above, in metres: camera, lamps, and the panel with the port at a distance."""
    half_m = port.panel_size_m[0] / 2
    ax.plot([-half_m, half_m], [distance_m + port.panel_depth_m] * 2, color=COLOUR["ink"], lw=3)
    for sign in (-1, 1):
        x = sign * np.array([port.ring_inner_radius_m, port.ring_outer_radius_m])
        ax.plot(x, [distance_m] * 2, color=COLOUR["truth"], lw=5, solid_capstyle="butt")
        edge = sign * camera.width_px / 2 / camera.fx_px
        ax.plot([0, 1.25 * distance_m * edge], [0, 1.25 * distance_m], ":", color=COLOUR["ink"], lw=0.8)
    ax.plot(0, 0, "s", color=COLOUR["ink"], ms=8)
    ax.annotate("camera", (0, 0), (-0.08, -0.17), ha="right")
    ax.annotate("panel with the port", (0, distance_m), (-0.45, distance_m - 0.05), ha="right")
    line = {"arrowstyle": "-", "color": COLOUR["ink"], "lw": 0.8}
    ax.annotate("field of view", (0.25, 0.47), (0.45, 0.47), va="center", arrowprops=line)
    for name, (place_m, colour) in LAMPS.items():
        x, _, z = place_m
        ax.plot(x, z, "o", color=COLOUR[colour], ms=9 if name == "sun" else 7)
        towards = np.array([0, distance_m]) - [x, z]
        beside = name == "lamp beside the camera"
        if not beside:
            tip = np.array([x, z]) + 0.35 * towards / np.linalg.norm(towards) * np.sqrt(np.hypot(*towards))
            ax.annotate("", tip, (x, z), arrowprops={"arrowstyle": "->", "color": COLOUR[colour], "lw": 1.6})
        at = (x, z - 0.45) if beside else (x - 0.05, z - 0.23)
        ax.annotate(name, (x, z), at, ha="center" if x > 0.5 else "left", arrowprops=line if beside else None)
    ax.grid(visible=False)  # its lines would cross the names
    ax.set(aspect="equal", xlim=(-2.5, 1.5), ylim=(-1.15, 0.85), xlabel="x (m)", ylabel="z, depth (m)",
           title="the laboratory from above")  # fmt: skip


class _Tap(EventSensor):
    """An event sensor that notes what one pixel (u, v) is shown."""

    def __init__(self, pixel, *args):
        super().__init__(*args)
        (self.u, self.v), self.seen = pixel, []

    def __call__(self, intensity, t_us):
        self.seen.append((t_us, float(intensity[self.v, self.u, 0])))
        return super().__call__(intensity, t_us)


def watch_pixel(sequence: Sequence, camera: Camera, port: Port, pixel, seconds: float) -> tuple:
    """Times (K,) in microseconds and light (K,) in 8-bit units at one pixel (u, v), and its events (N,)."""
    tap = _Tap(pixel, camera, SensorSettings(), sequence.rng(f"events {sequence.light}"))
    events = np.concatenate([e for _, e, _ in sequences.stream(sequence, camera, port, seconds, tap)])
    own = events[(events["x"] == tap.u) & (events["y"] == tap.v)]
    return *np.array(tap.seen).T, own
