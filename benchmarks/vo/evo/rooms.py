"""Rooms of textured planes and boxes; axes and lengths as in `scenes`."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.spatial.transform import Rotation

TEXEL_M = 0.004


@dataclass(frozen=True)
class Room:
    """Textured rectangles: ``frames (N, 3, 3)`` holds, in columns, both edges and the corner (m)."""

    frames: np.ndarray
    textures: tuple[np.ndarray, ...]


def room(layout: str) -> Room:
    """The rectangles of a layout, with textures drawn from its name."""
    rng = np.random.default_rng(zlib.crc32(layout.encode()))
    if layout == "boxes":
        frames = [
            _rectangle((-4.0, -3.0, 3.4), (8.0, 0, 0), (0, 6.0, 0)),
            _rectangle((-4.0, 1.0, 0.3), (8.0, 0, 0), (0, 0, 3.1)),
            *_box((-0.75, 0.55, 2.0), (0.5, 0.9, 0.5), 0.5),
            *_box((0.55, 0.65, 1.7), (0.45, 0.7, 0.4), -0.4),
            *_box((0.05, -0.45, 2.6), (0.7, 0.5, 0.4), 0.3),
            *_box((1.3, 0.2, 2.7), (0.5, 1.6, 0.5), 0.8),
            *_box((-1.4, -0.4, 2.8), (0.5, 0.6, 0.5), -0.6),
        ]
    elif layout == "desk":
        frames = [
            _rectangle((-3.0, -2.5, 3.0), (6.0, 0, 0), (0, 4.0, 0)),
            _rectangle((-1.6, 0.55, 0.7), (3.2, 0, 0), (0, -0.25, 2.2)),
            *_box((-0.45, 0.25, 1.4), (0.3, 0.45, 0.25), 0.4),
            *_box((0.30, 0.30, 1.2), (0.25, 0.3, 0.2), -0.5),
            *_box((0.10, 0.05, 1.9), (0.45, 0.5, 0.25), 0.15),
            *_box((0.85, 0.05, 1.8), (0.3, 0.6, 0.3), 0.9),
            *_box((-0.95, 0.0, 2.1), (0.4, 0.6, 0.3), -0.7),
        ]
    elif layout == "corner":
        frames = [
            _rectangle((-3.2, -3.0, 1.2), (3.2, 0, 2.2), (0, 5.0, 0)),
            _rectangle((0.0, -3.0, 3.4), (3.2, 0, -2.2), (0, 5.0, 0)),
            _rectangle((-4.0, 1.0, 0.3), (8.0, 0, 0), (0, 0, 3.4)),
            *_box((-0.6, 0.5, 1.9), (0.5, 1.0, 0.4), 0.6),
            *_box((0.65, 0.3, 2.0), (0.4, 1.4, 0.4), -0.3),
            *_box((0.05, -0.75, 2.2), (0.6, 0.35, 0.4), 0.2),
        ]
    else:
        raise ValueError(f"layout: expected boxes, desk or corner, got {layout!r}")
    sizes_m = [np.linalg.norm(frame[:, :2], axis=0) for frame in frames]
    return Room(np.array(frames), tuple(_texture(size, rng) for size in sizes_m))


def _rectangle(corner, edge_a, edge_b) -> np.ndarray:
    return np.stack([edge_a, edge_b, corner], -1).astype(float)


def _box(centre, size, yaw_rad: float) -> list[np.ndarray]:
    """Faces of a box that stands upright, turned about the vertical."""
    R = Rotation.from_rotvec([0, yaw_rad, 0]).as_matrix()
    faces = []
    for axis in range(3):
        a, b, n = np.roll(np.eye(3), -axis, 0) * np.roll(size, -axis)[:, None]
        faces += [R @ _rectangle(side * n / 2 - a / 2 - b / 2, a, b) for side in (-1, 1)]
    for face in faces:
        face[:, 2] += centre
    return faces


def _texture(size_m, rng: np.random.Generator) -> np.ndarray:
    """Reflectances of random polygons on grey: rows along the second edge, columns along the first."""
    columns, rows = np.maximum(np.ceil(np.asarray(size_m) / TEXEL_M).astype(int), 8)
    image = np.full((rows, columns), rng.uniform(0.25, 0.6), np.float32)
    for _ in range(3 + int(7 * size_m[0] * size_m[1])):
        centre, radius = rng.uniform(0, (columns, rows)), rng.uniform(0.06, 0.20) / TEXEL_M
        angles = np.sort(rng.uniform(0, 2 * np.pi, rng.integers(3, 6)))
        corners = centre + radius * np.stack([np.cos(angles), np.sin(angles)], -1)
        cv2.fillPoly(
            image, [corners.astype(np.int32)], float(np.exp(rng.uniform(np.log(0.08), np.log(0.95))))
        )
    return cv2.GaussianBlur(image, (0, 0), 0.6)
