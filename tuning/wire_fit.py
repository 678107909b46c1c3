"""The wire model's fit to pixels of lines that were drawn over pictures.

Pixels are those of a DAVIS 346.  The unknowns of a fit are one vector: the model's dimensions, which all
pictures share, a rotation vector and a position for each picture, and the logarithm of the focal length.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from wire_model import CHORDS, COUNT, DIMENSIONS, PIECE_COUNT, PIECES, SEGMENTS, WINDOW, vertices

from lmmap.errors import InputError
from lmmap.geometry.projection import project
from lmmap.pipeline import circle, ellipse
from lmmap.types import Camera, Pose

FOCAL_PX = Camera.davis346().fx_px
SAMPLES_CHORD, SAMPLES_SIDE = 3, 24  # places on a segment, about one a pixel
CANDIDATES = 3  # segments among which a pixel's nearest one is looked for
ROBUST_PX = 0.57  # where a distance begins to count less than its square
GATE_PX = 4.0  # pixels and lines further apart than this have nothing to do with each other
NEAR_PX = 1.2  # below it, the nearest pixel of a line lies across from it
BEHIND_PX = 1e6  # where points behind the camera are: far from every pixel
STEP = 1e-6  # of the derivatives
RESTARTS, SEED = 8, 0
ASIDE = 0.01  # standard deviation of each dimension where a fit begins anew
YAW_STEPS = 24  # in a third of a turn
SAMPLES = np.where(np.arange(len(SEGMENTS)) < 2 * CHORDS, SAMPLES_CHORD, SAMPLES_SIDE)
SAMPLED = np.repeat(np.arange(len(SEGMENTS)), SAMPLES)
FRACTION = np.concatenate([(np.arange(n) + 0.5) / n for n in SAMPLES])


@dataclass(frozen=True)
class Overlay:
    """Pixels (N, 2) of a picture's lines, and (M, 2) of the edges of its filled windows."""

    name: str
    size_px: tuple[float, float]
    lines_px: np.ndarray
    windows_px: np.ndarray

    def camera(self, focal_px: float) -> Camera:
        width, height = self.size_px
        return Camera(round(width), round(height), focal_px, focal_px, (width - 1) / 2, (height - 1) / 2)

    @cached_property
    def trees(self) -> tuple[cKDTree, cKDTree]:
        return cKDTree(self.lines_px), cKDTree(self.windows_px)


@dataclass(frozen=True)
class Pairs:
    """Pixels (R, 2), and the places on segments that they are compared with, along unit vectors (R, 2)."""

    segment: np.ndarray
    fraction: np.ndarray
    pixels_px: np.ndarray
    direction: np.ndarray
    distance_px: np.ndarray

    def places(self, corners) -> np.ndarray:
        """(..., V, 2) -> (..., R, 2)."""
        a, b = (corners[..., SEGMENTS[self.segment, end], :] for end in (0, 1))
        return a + self.fraction[:, None] * (b - a)


def paired(overlay: Overlay, corners_px) -> Pairs:
    """Of each pixel the nearest place on the projected lines, and of places all along them the nearest pixel.

    Edges of windows go with windows, and lines with all other lines.
    """
    start, end = (corners_px[SEGMENTS[SAMPLED, k]] for k in (0, 1))
    places_px = start + FRACTION[:, None] * (end - start)
    both = zip((overlay.lines_px, overlay.windows_px), overlay.trees, (False, True), strict=True)
    found = []
    for pixels, tree, of_windows in both:
        at = np.flatnonzero(WINDOW[SAMPLED] == of_windows)
        near = SAMPLED[at[cKDTree(places_px[at]).query(pixels, CANDIDATES)[1]]]
        a, b = (corners_px[SEGMENTS[near, k]] for k in (0, 1))
        out, step = pixels[:, None] - a, b - a
        t = np.clip(np.sum(out * step, -1) / np.maximum(np.sum(step**2, -1), 1e-12), 0, 1)
        off = t[..., None] * step - out
        best = np.arange(len(pixels)), np.sum(off**2, -1).argmin(1)
        found.append((near[best], t[best], pixels, off[best], np.full(len(pixels), 1e-9)))
        across = pixels[tree.query(places_px[at])[1]]
        found.append((SAMPLED[at], FRACTION[at], across, places_px[at] - across, np.full(len(at), NEAR_PX)))
    segment, fraction, pixels_px, off_px, near_px = (
        np.concatenate(part) for part in zip(*found, strict=True)
    )
    step = corners_px[SEGMENTS[segment, 1]] - corners_px[SEGMENTS[segment, 0]]
    normal, distance_px = np.column_stack([-step[:, 1], step[:, 0]]), np.linalg.norm(off_px, axis=1)
    direction = np.where((distance_px <= near_px)[:, None], normal, off_px)
    direction = direction / np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-12)
    return Pairs(segment, fraction, pixels_px, direction, distance_px)


class Fit:
    """Distances (px) between the pixels of all overlays and the model, as a function of all unknowns."""

    def __init__(self, overlays: list[Overlay]):
        self.overlays, self._known = overlays, (None, [])

    def corners_px(self, x, number: int) -> np.ndarray:
        """The model's vertices in an overlay, (V, 2)."""
        turn, position = np.split(x[COUNT + 6 * number : COUNT + 6 * number + 6], 2)
        T = Pose(Rotation.from_rotvec(turn).as_matrix(), position)
        corners_px = project(T @ vertices(x[:COUNT]), self.overlays[number].camera(np.exp(x[-1])))
        return np.nan_to_num(corners_px, nan=BEHIND_PX)

    def pairs(self, x) -> list[Pairs]:
        """Of each overlay."""
        if not np.array_equal(x, self._known[0]):
            found = [paired(overlay, self.corners_px(x, k)) for k, overlay in enumerate(self.overlays)]
            self._known = x.copy(), found
        return self._known[1]

    def residuals(self, x) -> np.ndarray:
        rows = []
        for k, pairs in enumerate(self.pairs(x)):
            off_px = pairs.places(self.corners_px(x, k)) - pairs.pixels_px
            rows.append(np.where(pairs.distance_px < GATE_PX, np.sum(pairs.direction * off_px, 1), GATE_PX))
        return np.concatenate(rows)

    def jacobian(self, x) -> np.ndarray:
        """Derivatives of the residuals while each pixel keeps its place."""
        rows = []
        for k, pairs in enumerate(self.pairs(x)):
            own = np.r_[:COUNT, COUNT + 6 * k : COUNT + 6 * k + 6, len(x) - 1]
            moved = [self.corners_px(x + STEP * unit, k) for unit in np.eye(len(x))[own]]
            slope = (np.array(moved) - self.corners_px(x, k)) / STEP
            J = np.zeros((len(pairs.segment), len(x)))
            J[:, own] = np.einsum("jrk,rk->rj", pairs.places(slope), pairs.direction)
            rows.append(J * (pairs.distance_px < GATE_PX)[:, None])
        return np.concatenate(rows)

    def pieces(self, x) -> np.ndarray:
        """The piece of line that each residual belongs to; the same line in two pictures is two pieces."""
        return np.concatenate(
            [k * PIECE_COUNT + PIECES[pairs.segment] for k, pairs in enumerate(self.pairs(x))]
        )

    def solve(self, x, free, rows=slice(None), steps: int = 50) -> tuple[np.ndarray, float]:
        """Robust least squares over the ``free`` unknowns (bool); the best x, and its cost."""

        def whole(part):
            y = np.array(x, float)
            y[free] = part
            return y

        fit = least_squares(
            lambda part: self.residuals(whole(part))[rows], x[free],
            lambda part: self.jacobian(whole(part))[rows][:, free],
            loss="soft_l1", f_scale=ROBUST_PX, x_scale="jac", max_nfev=steps, ftol=1e-6, xtol=1e-6,
        )  # fmt: skip
        return whole(fit.x), float(fit.cost)


def unknowns(dimensions, poses, focal_px: float = FOCAL_PX) -> np.ndarray:
    """The vector of a fit; ``poses`` are pairs of a rotation matrix and a position."""
    flat = [np.r_[Rotation.from_matrix(rotation).as_rotvec(), position] for rotation, position in poses]
    return np.concatenate([dimensions, *flat, [np.log(focal_px)]])


def first_pose(seen: Overlay, dimensions) -> tuple[np.ndarray, np.ndarray]:
    """Rotation and position in one picture, from its outermost pixels and a search over the yaw.

    Raises
    ------
    InputError
        If no ellipse runs through the outermost pixels.
    """
    points = np.concatenate([seen.lines_px, seen.windows_px])
    out = points - points.mean(0)
    sector = (np.degrees(np.arctan2(out[:, 1], out[:, 0])) // 3).astype(int)
    from_inside = np.argsort(np.hypot(*out.T), kind="stable")
    outermost = points[list(dict(zip(sector[from_inside], from_inside, strict=True)).values())]
    ring, _ = ellipse.fit_ransac(outermost, np.random.default_rng(SEED))
    if ring is None:
        raise InputError(f"{seen.name}: no ring runs around its green lines; take the picture out")
    both, fit, tried = circle.poses(ring, seen.camera(FOCAL_PX), 1.0), Fit([seen]), []
    for which, step in np.ndindex(2, YAW_STEPS):
        yaw = Rotation.from_rotvec([0, 0, step * 2 * np.pi / 3 / YAW_STEPS]).as_matrix()
        x = unknowns(dimensions, [(both.rotation[which] @ yaw, both.position_m[which])])
        tried.append((np.hypot(1, fit.residuals(x) / ROBUST_PX).sum(), which, step, x))
    pose = np.r_[[False] * COUNT, [True] * 6, False]
    x, _ = min((fit.solve(x, pose, steps=15) for *_, x in sorted(tried)[:4]), key=lambda solved: solved[1])
    return Rotation.from_rotvec(x[COUNT : COUNT + 3]).as_matrix(), x[COUNT + 3 : COUNT + 6]


def measured(overlays: list[Overlay], dimensions, restarts: int = RESTARTS) -> np.ndarray:
    """All unknowns at the bench's focal length: poses first, then more and more dimensions.

    Lines that all but coincide may have changed places, so the fit begins anew beside its best.
    """
    fit = Fit(overlays)
    x = unknowns(dimensions, [first_pose(seen, dimensions) for seen in overlays])
    name = np.array([*DIMENSIONS, *["pose"] * (len(x) - COUNT - 1), "focal"])
    windows, everything = np.char.startswith(name, "window"), name != "focal"
    for free in (np.isin(name, ["pose", "ring_inner", "plate_height"]), everything & ~windows, windows):
        x, _ = fit.solve(x, free)
    return anew(fit, x, everything, restarts)[0]


def at_focal(overlays: list[Overlay], x, focal_px: float | None) -> tuple[np.ndarray, float]:
    """The unknowns at another focal length, or with it free (None); and the cost."""
    x, free = x.copy(), np.ones(len(x), bool)
    if focal_px is not None:
        x[COUNT + 5 : -1 : 6] *= focal_px / np.exp(x[-1])
        x[-1], free[-1] = np.log(focal_px), False
    return anew(Fit(overlays), x, free, RESTARTS // 2)


def anew(fit: Fit, x, free, restarts: int) -> tuple[np.ndarray, float]:
    """The best of a fit from x and of more that begin beside the best so far; and its cost."""
    rng = np.random.default_rng(SEED)
    best, least = fit.solve(x, free)
    for _ in range(restarts):
        x, cost = fit.solve(beside(best, rng), free)
        if cost < least:
            best, least = x, cost
    return best, least


def beside(x, rng: np.random.Generator) -> np.ndarray:
    """The unknowns with other dimensions near them."""
    return x + np.r_[ASIDE * rng.standard_normal(COUNT), np.zeros(len(x) - COUNT)]
