"""The raised plate as a flat sheet: faces joined at folds, and where the folds bring them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from lmmap.types import Port

BORDER_M = 0.001  # dark paper between a marker and the plate's edge: a fold is not sharper
TAB_M = 0.010  # width of a glue tab
PLATE, WALL, FOOT, TAB = "plate", "wall", "foot", "tab"


@dataclass(frozen=True)
class Face:
    """A face of the sheet: ``corners_m`` (K, 2), of which the first two are its hinge, and the rotation about
    the hinge, from the first corner to the second, that folds it against the face number ``parent``."""

    kind: str
    corners_m: np.ndarray
    parent: int | None = None
    angle_rad: float = 0.0


def plate_sides(port: Port) -> int:
    """Two sides a marker, and at least four: a plate with two sides has no area."""
    return max(2 * port.symmetry, 4)


def paper_apothem_m(port: Port) -> float:
    """Distance of the paper plate's sides from the axis.

    On the LM-MAP the markers reach to the edge of the plate, and 0.15 mm beyond.  On paper they get a dark
    border, so the plate is a millimetre larger; its own size takes no part in the pose.
    """
    return max(port.apothem_m, port.marker_radius_m + port.marker_size_m[1] / 2 + BORDER_M)


def plate_net(port: Port) -> list[Face]:
    """The plate, and for each side a wall of its height, a foot to stand on and a tab that the next wall
    covers; the plate alone where it has no height.

    Coordinates are the port's x and y, seen from the printed side.
    """
    count, apothem, height = plate_sides(port), paper_apothem_m(port), port.plate_height_m
    turn = 2 * np.pi / count
    half_side = apothem * np.tan(turn / 2)
    angles = (np.arange(count) - 0.5) * turn
    corners = apothem / np.cos(turn / 2) * np.stack([np.cos(angles), np.sin(angles)], -1)
    faces = [Face(PLATE, corners)]
    if height <= 0:
        return faces
    width = min(TAB_M, half_side, height / 2)
    foot, bevel = min(TAB_M, half_side), width / np.tan(min(0.8 * turn, np.pi / 4))
    end = apothem + height
    for k in range(count):
        c, s = np.cos(k * turn), np.sin(k * turn)

        def place(x, y, c=c, s=s):
            return np.stack([c * np.array(x) - s * np.array(y), s * np.array(x) + c * np.array(y)], -1)

        wall = place([apothem, apothem, end, end], half_side * np.array([-1, 1, 1, -1]))
        inset = half_side - np.array([0, 0, foot / 2, foot / 2])
        standing = place([end, end, end + foot, end + foot], inset * np.array([-1, 1, 1, -1]))
        beside = place([apothem, end, end - min(bevel, height / 2), apothem + min(bevel, height / 2)],
                       half_side + np.array([0, 0, width, width]))  # fmt: skip
        parent = len(faces)
        faces.append(Face(WALL, wall, 0, np.pi / 2))
        faces.append(Face(FOOT, standing, parent, -np.pi / 2))
        faces.append(Face(TAB, beside, parent, -turn))
    return faces


def fold(faces: list[Face]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Rotation (3, 3) and translation (3,) that take each face's sheet coordinates, at z = 0, to where the
    folds bring them; the first face stays."""
    moves: list[tuple[np.ndarray, np.ndarray]] = []
    for face in faces:
        if face.parent is None:
            moves.append((np.eye(3), np.zeros(3)))
            continue
        first, second = (np.append(corner, 0.0) for corner in face.corners_m[:2])
        axis = (second - first) / np.linalg.norm(second - first)
        own = Rotation.from_rotvec(face.angle_rad * axis).as_matrix()
        R, t = moves[face.parent]
        moves.append((R @ own, R @ (first - own @ first) + t))
    return moves


def moved(points_m: np.ndarray, move: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Points (..., 2) of the sheet after a move of `fold`, (..., 3)."""
    R, t = move
    return points_m @ R[:, :2].T + t
