"""The dimensioned drawing of the port, of the chapter on port and frames."""

from __future__ import annotations

import numpy as np
from matplotlib.patches import Circle, Polygon, Rectangle

from lmmap.types import Port

from .drawings import COLOUR

MM = 1e3
RING, MARKER, PLATE = COLOUR["rgb"], COLOUR["event"], COLOUR["ink"]
SCALE = {"ylim": (-120, 100), "aspect": "equal"}  # of both views


def draw_front(ax, port: Port) -> None:
    """The port from the front, in millimetres: ring, plate, windows, markers, and the frame's axes."""
    for radius_m in (port.ring_outer_radius_m, port.ring_inner_radius_m):
        ax.add_patch(Circle((0, 0), radius_m * MM, fill=False, color=RING, lw=1.5))
    corner = np.deg2rad(30 + 60 * np.arange(6))
    hexagon_mm = port.plate_circumradius_m * MM * np.column_stack([np.cos(corner), np.sin(corner)])
    ax.add_patch(Polygon(hexagon_mm, fill=False, color=PLATE))
    windows_mm = port.window_corners_m()[..., :2] * MM
    for corners_mm in windows_mm:
        ax.add_patch(Polygon(corners_mm, fill=False, color=PLATE))
    if len(windows_mm):
        _name(ax, "window", windows_mm[-1].mean(0), (78, -98))
    for k, corners_m in enumerate(port.marker_corners_m()):
        ax.add_patch(Polygon(corners_m[:, :2] * MM, color=MARKER, alpha=0.75, lw=0))
        off_axis_mm = corners_m[[1, 2, 2, 3], :2].mean(0) * MM
        ax.annotate(str(k), off_axis_mm, color="white", ha="center", va="center")
    for tip, at, name in (((66, 0), (62, 7), "x"), ((0, 66), (7, 62), "y")):
        ax.annotate("", tip, (0, 0), arrowprops={"arrowstyle": "->", "color": COLOUR["truth"], "lw": 1.6})
        ax.annotate(name, at, color=COLOUR["truth"], ha="center", va="center")
    end_mm = port.ring_radius_m * MM * np.array([np.cos(np.deg2rad(215)), np.sin(np.deg2rad(215))])
    ax.annotate("", end_mm, (0, 0), arrowprops={"arrowstyle": "<->", "color": RING})
    ax.annotate("ν", 0.78 * end_mm + [-5, 4], color=RING, ha="center")
    _name(ax, "ring", (0, -86), (0, -112), RING)
    _name(ax, "plate", hexagon_mm[4] * 0.98, (38, -112))
    ax.set(xlim=(-100, 100), xlabel="x (mm)", ylabel="y (mm)", title="from the front", **SCALE)


def draw_side(ax, port: Port) -> None:
    """The port in section through the axis, in millimetres: to the right is the camera's side."""
    side_mm, height_mm = port.apothem_m * MM, port.plate_height_m * MM
    depth_mm = port.panel_depth_m * MM
    ax.add_patch(Rectangle((-depth_mm - 8, -100), 8, 200, color=PLATE, alpha=0.25, lw=0))
    for sign in (-1, 1):
        inner, outer = sign * port.ring_inner_radius_m * MM, sign * port.ring_outer_radius_m * MM
        ax.add_patch(
            Rectangle((-depth_mm, min(inner, outer)), depth_mm, abs(outer - inner), color=PLATE, alpha=0.25)
        )
        ax.plot([0, 0], [inner, outer], color=RING, lw=4, solid_capstyle="butt")
    stem_mm = port.stem_radius_m * MM
    ax.add_patch(
        Rectangle((-depth_mm, -stem_mm), height_mm + depth_mm, 2 * stem_mm, color=PLATE, alpha=0.25, lw=0)
    )
    middle_mm, half_mm = port.window_radius_m * MM, port.window_size_m[1] * MM / 2  # opposite marker 0
    for ends_mm in ((-side_mm, -middle_mm - half_mm), (-middle_mm + half_mm, side_mm)):
        ax.plot([height_mm] * 2, ends_mm, color=PLATE, lw=1.5, solid_capstyle="butt")
    middle_mm, half_mm = port.marker_radius_m * MM, port.marker_size_m[1] * MM / 2
    ax.plot(
        [height_mm] * 2, [middle_mm - half_mm, middle_mm + half_mm], color=MARKER, lw=4, solid_capstyle="butt"
    )
    ax.plot(
        [height_mm, height_mm + port.petal_rise_m * MM],
        [side_mm, side_mm + port.petal_lean_m * MM],
        color=PLATE,
    )
    ax.annotate("", (96, 0), (0, 0), arrowprops={"arrowstyle": "->", "color": COLOUR["truth"], "lw": 1.6})
    ax.annotate("z, toward\nthe camera", (80, -24), color=COLOUR["truth"], ha="center")
    ax.annotate("", (height_mm, -72), (0, -72), arrowprops={"arrowstyle": "<->", "color": PLATE})
    ax.annotate(f"{height_mm:.0f} mm", (height_mm / 2, -84), ha="center")
    _name(ax, "petal", (height_mm + 18, side_mm + 9), (86, 86))
    _name(ax, "marker 0", (height_mm + 1, middle_mm - 3), (88, 34), MARKER)
    _name(ax, "panel", (-13, -92), (12, -108))
    ax.set(xlim=(-30, 112), xlabel="z (mm)", ylabel="x (mm)", title="from the side", **SCALE)


def _name(ax, text: str, at_mm, beside_mm, colour: str = PLATE) -> None:
    """A name, with a line to what it names."""
    line = {"arrowstyle": "-", "color": colour}
    ax.annotate(text, at_mm, beside_mm, color=colour, ha="center", arrowprops=line)
