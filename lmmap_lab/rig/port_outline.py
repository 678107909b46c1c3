"""What is measured of a port: five dimensions, and the edges of ring and markers that they decide."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from lmmap.geometry.port import circle_points_m
from lmmap.types import Port, frozen_array

DIMENSIONS = ("plate's height", "markers' radius", "markers' length", "markers' depth", "ring's width")
RING_POINTS, SIDE_POINTS = 72, 8  # of each of the ring's circles, and of each side of a marker
OF_RING = slice(0, 2 * RING_POINTS)  # in the order of `outline`
WINDOW_SHARES = tuple(k / 10 for k in range(10, -1, -1))  # of their size, tried in this order
KINDS = 2  # of edges: the ring's and the markers'


class Outline(NamedTuple):
    """Points (K, 3) m on the edges of ring and markers, with directions (K, 3) along the edge and outward:
    away from what a mask covers."""

    points_m: np.ndarray
    along: np.ndarray
    outward: np.ndarray


def dimensions_m(port: Port) -> np.ndarray:
    """Values (5,) of `DIMENSIONS`."""
    width_m = port.ring_outer_radius_m - port.ring_inner_radius_m
    return np.array([port.plate_height_m, port.marker_radius_m, *port.marker_size_m, width_m])


def with_dimensions(port: Port, values_m) -> Port:
    """A port with other `DIMENSIONS` (5,): its ring as wide within as without its centre line, its plate and
    its windows larger in the ratio in which the markers' outer sides are further out, and all else as it was.
    Windows that would then overlap the markers are smaller, by as many tenths as it takes.
    """
    height_m, radius_m, length_m, depth_m, width_m = map(float, values_m)
    growth = (radius_m + depth_m / 2) / (port.marker_radius_m + port.marker_size_m[1] / 2)
    for share in WINDOW_SHARES:
        try:
            return replace(
                port, plate_height_m=height_m, marker_radius_m=radius_m, marker_size_m=(length_m, depth_m),
                ring_inner_radius_m=port.ring_radius_m - width_m / 2,
                ring_outer_radius_m=port.ring_radius_m + width_m / 2,
                plate_circumradius_m=port.plate_circumradius_m * growth,
                window_radius_m=port.window_radius_m * growth,
                window_size_m=tuple(share * growth * size_m for size_m in port.window_size_m),
            )  # fmt: skip
        except ValueError:
            if not share:
                raise


def windows_share(port: Port, start: Port) -> float:
    """How large the windows of `with_dimensions` are, of what the plate's growth from the start would make
    them."""
    grown_m = start.window_size_m[0] * port.plate_circumradius_m / start.plate_circumradius_m
    return port.window_size_m[0] / grown_m if grown_m else 1.0


@lru_cache(maxsize=16)
def outline(port: Port) -> Outline:
    """The ring's outer and inner edge, then the markers' sides without their corners."""
    circle = circle_points_m(1.0, RING_POINTS)
    turned = np.stack([-circle[:, 1], circle[:, 0], circle[:, 2]], -1)
    corners = port.marker_corners_m()
    side = np.roll(corners, -1, 1) - corners
    middle = corners + side / 2
    at_side = middle[:, :, None] + np.linspace(-0.3, 0.3, SIDE_POINTS)[:, None] * side[:, :, None]
    outer, inner = port.ring_outer_radius_m * circle, port.ring_inner_radius_m * circle
    along, outward = (np.broadcast_to(v[:, :, None], at_side.shape).reshape(-1, 3)
                      for v in (side, middle - corners.mean(1, keepdims=True)))  # fmt: skip
    return Outline(*map(frozen_array, (
        np.concatenate([outer, inner, at_side.reshape(-1, 3)]),
        np.concatenate([turned, turned, along]), np.concatenate([circle, -circle, outward]),
    )))  # fmt: skip


def kinds_of(count: int) -> np.ndarray:
    """Of each point of an outline (K,): 0 if it is the ring's, 1 if it is a marker's."""
    return (np.arange(count) >= OF_RING.stop).astype(int)
