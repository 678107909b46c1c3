"""Normal and yaw from the image's own edges: the plate's rim, the markers' outlines, the petals' tips.

In glare the reflector mask is faint and coarse, but the image shows the outline of what stands on the plate.
The rim has six sides and so cannot tell yaws apart that differ by 60 deg; markers and petals decide.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from ..geometry.markers import polar_grid
from ..geometry.projection import project_points
from ..geometry.sampling import sample
from ..settings import OURS, Settings
from ..types import Camera, Port, Pose, frozen_array

EDGE_BLUR_PX = 1.0
EDGE_WINDOW_PX = 25  # in which an edge is compared with its neighbourhood
SATURATED = 8  # events of a pixel that count as an edge as strong as any
NOISE = {"rgb": 0.15, "event": 0.3}  # a neighbourhood without edges: root of grey levels a pixel, events
LINE_M = 0.0015  # standard deviation of a line's width in the templates


def edges(image) -> np.ndarray:
    """Strength of an image's edges at each pixel, relative to the neighbourhood, (H, W).

    For frames (H, W, 3), this is the gradient of the square root of light, which makes the noise uniform; a
    histogram (H, W) already consists of edges.
    """
    image = np.asarray(image, np.float32)
    if image.ndim == 3:
        root = np.sqrt(cv2.transform(image, np.full((1, 3), 1 / 3, np.float32)))
        root = cv2.GaussianBlur(root, (0, 0), EDGE_BLUR_PX)
        strength = cv2.magnitude(*(cv2.Scharr(root, -1, *d, scale=1 / 32) for d in ((1, 0), (0, 1))))
        noise = NOISE["rgb"]
    else:
        strength = cv2.GaussianBlur(np.minimum(image, SATURATED), (0, 0), EDGE_BLUR_PX)
        noise = NOISE["event"]
    return strength / (cv2.blur(strength, (EDGE_WINDOW_PX, EDGE_WINDOW_PX)) + noise)


def support(strength, T_cam_port: Pose, port: Port, camera: Camera, yaws: int) -> np.ndarray:
    """Mean of an image's `edges` (H, W) along the rim, the markers' outlines and the petals' tips, for poses
    (N,) at ``yaws`` yaws over one period, shape (N, yaws, 3)."""
    points_m, spectra = _lines(port, yaws)
    value = sample(strength, project_points(T_cam_port, points_m, camera))
    folded = value.reshape(len(value), len(points_m), port.symmetry, -1).mean(2)
    spectrum = np.einsum("nrf,krf->nfk", np.fft.rfft(folded), spectra)
    return np.fft.irfft(spectrum, yaws, axis=1)


def log_odds(log_probability, T_cam_port: Pose, port: Port, settings: Settings = OURS) -> float:
    """Logarithm of the odds that the most probable of poses (N,) and yaws is right.

    ``log_probability`` (N, yaws) is unnormalised.  A pose counts as right if its normal and yaw are within
    ``right_normal_rad`` and ``right_rotation_rad`` of the best one's.
    """
    p = np.exp(log_probability - np.max(log_probability))
    best, at = np.unravel_index(p.argmax(), p.shape)
    steps = np.abs(np.arange(p.shape[1]) - at)
    apart_rad = np.minimum(steps, p.shape[1] - steps) * (port.yaw_period_rad / p.shape[1])
    alike = T_cam_port.normal @ T_cam_port.normal[best] >= np.cos(settings.right_normal_rad)
    right = np.outer(alike, apart_rad <= settings.right_rotation_rad)
    return float(np.log(p[right].sum()) - np.log(max(p[~right].sum(), 1e-9)))


@lru_cache
def _lines(port: Port, yaws: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (R, A, 3) of `_plate` and `_tips`, and the spectra (3, R, F) of all their lines."""
    (plate_m, of_plate), (tips_m, of_tips) = _plate(port, yaws), _tips(port, yaws)
    spectra = np.zeros((3, len(plate_m) + len(tips_m), of_tips.shape[-1]), complex)
    spectra[:2, : len(plate_m)], spectra[2:, len(plate_m) :] = of_plate, of_tips
    return frozen_array(np.concatenate([plate_m, tips_m])), frozen_array(spectra, complex)


def _plate(port: Port, yaws: int, radial: int = 16) -> tuple[np.ndarray, np.ndarray]:
    """Points (R, A, 3) of the plate's plane, and `_spectra` (2, R, F) of rim and markers' outlines."""
    half_tangential, half_radial = np.array(port.marker_size_m) / 2
    near_m, far_m = port.marker_radius_m - half_radial - 0.006, port.plate_circumradius_m + 0.004
    points_m, along, across = _polar(port, np.linspace(near_m, far_m, radial), port.plate_height_m, yaws)
    sides = [np.cos(k * np.pi / port.symmetry) * along - np.sin(k * np.pi / port.symmetry) * across
             for k in range(2 * port.symmetry)]  # fmt: skip
    from_rim = np.max(sides, 0) - port.apothem_m
    beyond_radial, beyond = (
        np.abs(along - port.marker_radius_m) - half_radial,
        np.abs(across) - half_tangential,
    )
    outside = np.hypot(np.maximum(beyond_radial, 0), np.maximum(beyond, 0))
    from_marker = outside + np.minimum(np.maximum(beyond_radial, beyond), 0)
    free_of_rim = np.abs(from_rim) > 2 * LINE_M
    return points_m, _spectra([_line(from_rim), _line(from_marker) * free_of_rim], points_m, yaws)


def _tips(port: Port, yaws: int, radial: int = 6) -> tuple[np.ndarray, np.ndarray]:
    """As `_plate` of the plane of the petals' tips."""
    tip_m = port.apothem_m + port.petal_lean_m
    height_m = port.plate_height_m + port.petal_rise_m
    points_m, along, across = _polar(port, tip_m + LINE_M * np.linspace(-2, 4, radial), height_m, yaws)
    tip = _line(along - tip_m) * (np.abs(across) < port.petal_widths_m[1] / 2)
    return points_m, _spectra([tip], points_m, yaws)


def _polar(port: Port, radii_m, height_m: float, yaws: int):
    """Points (R, A, 3) on circles of a plane, and their coordinates along and across the nearest marker's
    direction, (R, A) each."""
    points_m, angle = polar_grid(port, radii_m, height_m, yaws)
    half, radii_m = port.yaw_period_rad / 2, radii_m[:, None]
    nearest = (angle + half) % port.yaw_period_rad - half
    return points_m, radii_m * np.cos(nearest), radii_m * np.sin(nearest)


def _line(distance_m) -> np.ndarray:
    return np.exp(-0.5 * (distance_m / LINE_M) ** 2)


def _spectra(lines, points_m, yaws: int) -> np.ndarray:
    """Conjugate spectra (K, R, F) of weights of sum 1 over one period, by area: factors of a correlation."""
    weighted = np.array(lines) * np.linalg.norm(points_m[..., :2], axis=-1)
    period = weighted[..., :yaws]
    return frozen_array(np.conj(np.fft.rfft(period / period.sum((1, 2), keepdims=True))), complex)
