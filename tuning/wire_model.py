"""A wire model of the port, in units of the ring's outer radius: its dimensions, vertices and lines."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from lmmap.geometry.port import circle_points_m

DIMENSIONS = (
    "ring_inner", "plate_height", "marker_inner", "marker_outer", "marker_half_length", "plate_circumradius",
    "window_centre", "window_half_radial", "window_half_tangential",
    "petal_rise", "petal_lean", "petal_half_width_at_plate", "petal_half_width_at_tip",
)  # fmt: skip
COUNT = len(DIMENSIONS)
CHORDS, CHORDS_A_PIECE = 120, 10  # of a circle


def _wires() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of each segment its two vertices (S, 2), its piece of line (S,), and whether it is a window's.

    A piece is a side of a polygon or 30 degrees of a circle.  A petal's fourth side is the plate's.
    """
    chord = np.arange(CHORDS)
    circle = np.column_stack([chord, (chord + 1) % CHORDS])
    segments, first = [circle, CHORDS + circle], 2 * CHORDS
    for corners, sides in [(6, 6), *[(4, 4)] * 6, *[(4, 3)] * 3]:  # plate; markers and windows; petals
        side = np.arange(sides)
        segments.append(first + np.column_stack([side, (side + 1) % corners]))
        first += corners
    segments = np.concatenate(segments)
    arcs, sides = 2 * CHORDS // CHORDS_A_PIECE, len(segments) - 2 * CHORDS
    pieces = np.concatenate([np.arange(2 * CHORDS) // CHORDS_A_PIECE, arcs + np.arange(sides)])
    number = np.arange(len(segments)) - 2 * CHORDS
    return segments, pieces, (number >= 18) & (number < 30)


SEGMENTS, PIECES, WINDOW = _wires()
PIECE_COUNT = PIECES.max() + 1


def vertices(dimensions) -> np.ndarray:
    """The wire model's vertices in the port's frame, (13,) -> (V, 3)."""
    d = dict(zip(DIMENSIONS, dimensions, strict=True))
    height = (d["plate_height"],) * 2
    window, half = d["window_centre"], d["window_half_radial"]
    side = d["plate_circumradius"] * np.cos(np.pi / 6)
    marker = _quadrangle((d["marker_inner"], d["marker_outer"]), (d["marker_half_length"],) * 2, height)
    cut = _quadrangle((window - half, window + half), (d["window_half_tangential"],) * 2, height)
    widths = d["petal_half_width_at_plate"], d["petal_half_width_at_tip"]
    petal = _quadrangle((side, side + d["petal_lean"]), widths, (height[0], height[0] + d["petal_rise"]))
    circles = [circle_points_m(radius, CHORDS) for radius in (1.0, d["ring_inner"])]
    plate = circle_points_m(d["plate_circumradius"], 6) @ _about_z(np.pi / 6).T + [0, 0, height[0]]
    shapes = (marker, 0), (cut, np.pi / 3), (petal, 0)
    turned = [shape @ _about_z(at + k * 2 * np.pi / 3).T for shape, at in shapes for k in range(3)]
    return np.concatenate([*circles, plate, *turned])


def _quadrangle(x, half_widths, z) -> np.ndarray:
    """Corners (4, 3), symmetric about the x axis, at the first, second, second and first of each pair."""
    there_and_back = np.array([x, half_widths, z], float)[:, [0, 1, 1, 0]].T
    return there_and_back * np.column_stack([np.ones(4), [-1, -1, 1, 1], np.ones(4)])


def _about_z(angle_rad: float) -> np.ndarray:
    return Rotation.from_rotvec([0, 0, angle_rad]).as_matrix()
