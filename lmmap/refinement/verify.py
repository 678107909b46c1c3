"""Does the whole port explain masks and image at a pose?  Evidence for and against it, and a confidence.

The ring's plane is unwrapped to angle and radius about the pose's axis.  There the ring is a straight band
between two edges whose radii are known, hidden where plate or petals stand in front of it.  An ellipse that
joins an arc of the ring to the edge of a shadow has a part of the mask inside it, and the image lacks the
inner edge where it should be.  Markers that do not match the mask are evidence against the yaw.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from ..geometry.compiled import njit
from ..geometry.projection import project_points
from ..geometry.sampling import sample
from ..settings import OURS, Settings
from ..types import Camera, Port, Pose
from ..types.arrays import frozen_array

OF_RING = 5  # of the evidence; the last of them is of the yaw as well
ANGLES = 72
RADII = np.arange(0.68, 1.0151, 0.015)  # of the unwrapped ring plane, in ring radii
EDGE_NEAR, EDGE_FAR = 0.0375, 0.0925  # from an edge: it is looked for here, nothing stronger there
BLUR_PX = 0.7  # of the image before its edges are measured
SATURATED = 8  # events of a pixel that count as an edge as strong as any
INSIDE = 0.06  # of the ring's radius, within its inner edge: from there the mask should be empty
HALO_M = 0.004  # about a marker's outline, what a mask's blur of two pixels spreads
NEIGHBOURHOOD_M = 0.062  # radius about the port's axis in which the markers' mask is to be explained
STEP_M = 0.002
TOUCHING_M = 0.001  # along a ray: a part so little before a point touches it, and does not hide it


def hidden(points_m, eye_m, port: Port) -> np.ndarray:
    """Whether plate or petals stand between points (N, 3) and an eye (3,), both in the port frame (m), (N,).

    The plate is a regular polygon that has, for each marker, a side with a petal and a side opposite it.
    Its windows hide nothing.
    """
    petal = (*port.petal_widths_m, port.petal_rise_m, port.petal_lean_m)
    window = (port.window_radius_m, *port.window_size_m)
    points, eye = np.array(points_m, float, order="C"), np.array(eye_m, float)
    return _hidden(points, eye, port.symmetry, port.apothem_m, port.plate_height_m, petal, window)


@njit(nogil=True, error_model="numpy")
def _hidden(points, eye, symmetry, apothem, height, petal, window):
    (base_width, tip_width, rise, lean), (radius, tangential, radial) = petal, window
    is_hidden = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        ray = points[i] - eye
        before = 1 - TOUCHING_M / np.sqrt(np.sum(ray * ray))  # share of the ray where what hides it ends
        share = (height - eye[2]) / ray[2]  # of the ray, where it meets the plate's plane
        x, y = eye[0] + share * ray[0], eye[1] + share * ray[1]
        by_plate, by_petal = share < before, False
        for k in range(symmetry):
            yaw, between = k * 2 * np.pi / symmetry, (k + 0.5) * 2 * np.pi / symmetry
            c, s = np.cos(yaw), np.sin(yaw)
            by_plate &= abs(x * c + y * s) < apothem
            a, b = np.cos(between), np.sin(between)
            in_window = abs(x * a + y * b - radius) < radial / 2 and abs(y * a - x * b) < tangential / 2
            by_plate &= not in_window
            # a petal's plane rises outward from its base: rise * (outward - apothem) = lean * (z - height)
            gap = rise * (apothem - eye[0] * c - eye[1] * s) - lean * (height - eye[2])
            to_petal = gap / (rise * (ray[0] * c + ray[1] * s) - lean * ray[2])
            up = (eye[2] + to_petal * ray[2] - height) / rise
            across = (eye[1] + to_petal * ray[1]) * c - (eye[0] + to_petal * ray[0]) * s
            within = abs(across) < ((1 - up) * base_width + up * tip_width) / 2
            by_petal |= 0 < to_petal < before and 0 < up < 1 and within
        is_hidden[i] = by_plate or by_petal
    return is_hidden


def ring_evidence(ring_mask, image, T_cam_port: Pose, port: Port, camera: Camera) -> tuple[float, float]:
    """Mean of a ring mask (H, W) inside the ring, and the fraction of its inner edge that the image shows.

    Both are taken over the angles at which the port does not hide the ring.  An edge counts as shown if the
    image changes more, or a histogram holds more events, at the edge's radius than beside it.
    """
    points_m = _ring_plane_m(port)
    seen = ~hidden(points_m[:, -2], T_cam_port.inverse.position_m, port)
    if not seen.any():
        return 1.0, 0.0
    inner = port.ring_inner_radius_m / port.ring_radius_m
    at = project_points(T_cam_port, points_m, camera)
    inside = sample(ring_mask, at[seen])[:, inner - INSIDE > RADII].mean()
    value = sample(_light(image), at[seen])
    edge = np.abs(value[:, 2:] - value[:, :-2]) if np.ndim(image) == 3 else value[:, 1:-1]
    away = np.abs(RADII[1:-1] - inner)
    near, beside = away <= EDGE_NEAR, (away > EDGE_NEAR) & (away <= EDGE_FAR)
    shown = edge[:, near].max(1) > edge[:, beside].max(1)
    return float(inside), float(shown.mean())


def _light(image) -> np.ndarray:
    """What the edges of an image are measured on, blurred, (H, W): the square root of a frame's light, as its
    noise is then alike everywhere, or a histogram's counts."""
    image = np.asarray(image, np.float32)
    grey = cv2.transform(image, np.full((1, 3), 1 / 3)) if image.ndim == 3 else None
    values = np.minimum(image, SATURATED) if grey is None else np.sqrt(grey)
    return cv2.GaussianBlur(values, (0, 0), BLUR_PX)


def marker_evidence(reflector_mask, T_cam_port: Pose, port: Port, camera: Camera) -> float:
    """Fraction of a reflector mask (H, W) around the port's axis that lies on the markers or their blur."""
    points_m, on_markers = _marker_plane(port)
    value = sample(reflector_mask, project_points(T_cam_port, points_m, camera))
    return float(value[on_markers].sum() / max(value.sum(), 1e-6))


def evidence(
    T_cam_port: Pose, covariance, markers_off_px: float, log_odds: float, image, ring_mask, reflector_mask,
    port: Port, camera: Camera,
) -> np.ndarray:  # fmt: skip
    """Evidence for a pose, shape (6,): the first `OF_RING` values concern the ring, the last two the yaw.

    They are the logarithm of the position's standard deviation along its worst direction (m), the two of
    `ring_evidence`, the distance of the markers from where the port's geometry puts them (px), the log odds
    of normal and yaw (`YawFit.log_odds`), and `marker_evidence`.
    """
    variance = np.linalg.eigvalsh(np.asarray(covariance)[:3, :3])[-1]
    return np.array([
        0.5 * np.log(max(variance, 1e-12)),
        *ring_evidence(ring_mask, image, T_cam_port, port, camera),
        markers_off_px,
        log_odds,
        marker_evidence(reflector_mask, T_cam_port, port, camera),
    ])  # fmt: skip


def confidence(evidence, settings: Settings = OURS) -> np.ndarray:
    """Probability (...) that a pose is right, given its evidence (..., 6): the probability of position and
    normal, times that of the yaw given these, each a logistic function."""
    evidence = np.asarray(evidence)
    ring, of_yaw = settings.confidence_ring, settings.confidence_yaw
    return logistic(evidence[..., :OF_RING], ring) * logistic(evidence[..., OF_RING - 1 :], of_yaw)


def logistic(x, weights) -> np.ndarray:
    """Logistic probabilities (...) of x (..., K), with a constant and slopes as ``weights`` (K + 1,)."""
    return 1 / (1 + np.exp(-np.clip(weights[0] + np.asarray(x) @ np.asarray(weights[1:]), -50, 50)))


@lru_cache
def _ring_plane_m(port: Port) -> np.ndarray:
    """Points (ANGLES, R, 3) of the ring's plane, out to the middle of the ring."""
    angle = np.arange(ANGLES) * (2 * np.pi / ANGLES)
    r = RADII * port.ring_radius_m
    x, y = np.multiply.outer(np.cos(angle), r), np.multiply.outer(np.sin(angle), r)
    return frozen_array(np.stack([x, y, np.zeros_like(x)], -1))


@lru_cache
def _marker_plane(port: Port) -> tuple[np.ndarray, np.ndarray]:
    """Points (A, B, 3) of the markers' plane about the axis, and which are on a marker or its halo."""
    line = np.arange(-NEIGHBOURHOOD_M, NEIGHBOURHOOD_M + STEP_M / 2, STEP_M)
    x, y = np.meshgrid(line, line)
    yaws = np.arange(port.symmetry) * port.yaw_period_rad
    radial = np.multiply.outer(np.cos(yaws), x) + np.multiply.outer(np.sin(yaws), y)
    tangential = np.multiply.outer(np.cos(yaws), y) - np.multiply.outer(np.sin(yaws), x)
    half_tangential, half_radial = np.array(port.marker_size_m) / 2 + HALO_M
    on = np.abs(tangential) <= half_tangential
    on &= np.abs(radial - port.marker_radius_m) <= half_radial
    points = np.stack([x, y, np.full_like(x, port.plate_height_m)], -1)
    near = np.hypot(x, y) <= NEIGHBOURHOOD_M
    points = np.where(near[..., None], points, np.nan)  # nothing is sampled in the square's corners
    return frozen_array(points), frozen_array(on.any(0) & near, bool)
