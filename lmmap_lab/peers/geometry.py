"""Geometry alone: the pipeline with ellipse detectors and brightness in place of its two networks.

Candidates come from two detectors on OpenCV: ellipses through contours, and templates of the ring.  The best
are moved and bent until both edges of the ring, the inner and the outer one, lie on edges of the image, and
the one wins that fits best.  Inside it, markers are what is brightest in a frame, and what lines of events
enclose in a histogram.  All that follows is the estimator's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import cv2
import numpy as np
from skimage.filters import threshold_multiotsu

from lmmap.geometry.sampling import sample
from lmmap.pipeline import outline
from lmmap.pipeline.estimator import Estimator
from lmmap.settings import OURS, PerCamera, Settings
from lmmap.types import Camera, Port

DETECTORS = "contours", "templates"
LEVELS = 12  # of brightness at which contours are taken
CANNY = 40, 100  # thresholds on the gradient of `grey`
SATURATED = 6  # events of a pixel that are as bright as any
LEAST_POINTS = 20  # of a contour, for its ellipse
SIZES_PX, TEMPLATES = (12.0, 80.0), 16  # semi-axes of the templates
SHAPES = (1.0, 0.0), *((0.8, k * np.pi / 4) for k in range(4))  # ratio of their axes, and angle
STRONGEST = 3.0  # an edge's strength beyond which it counts no more
ANGLES = 90  # around an ellipse
BLURS_PX = 2.0, 1.0, 0.0  # of the edges, while the best `KEPT` candidates climb
KEPT, ROUNDS, NEIGHBOURS, SHRINK = 12, 8, 40, 0.75
LEAST_SCORE = 0.45  # of a ring, in units of the edges of its neighbourhood
REACH = 0.8  # of the ring's radius, within which markers appear, in spite of parallax
QUIET = 0.7  # share of the pixels inside the ring that no line of events crosses
MARKER_AREAS = 0.3, 1.3  # of a quiet spot, in the marker's area
FAINT = 0.25
SIGMA_PX = 1.0  # of the drawn ring: the estimator then sharpens the pose on the image's own edges


def estimator(modality: str, camera: Camera | None = None, port: Port | None = None,
              detectors: tuple[str, ...] = DETECTORS,
              settings: Settings = OURS) -> Estimator:  # fmt: skip
    """An `Estimator` without networks.  A look at the turned image would show it nothing new, and to find the
    yaw it trusts the edges of histograms as it does those of frames, for its masks of them are poor."""
    weights, port = settings.yaw_weights["rgb"], port or Port.lm_map()
    settings = replace(settings, turned_look=False, min_sigma_px=SIGMA_PX,
                       yaw_weights=PerCamera(rgb=weights, event=weights))  # fmt: skip
    return Estimator(camera, port, modality, masks(port, detectors), settings)


def masks(port: Port, detectors: tuple[str, ...] = DETECTORS) -> tuple[Callable, Callable]:
    """The masks (H, W) of ring and markers, as functions of an image, frame (H, W, 3) or histogram (H, W)."""

    @lru_cache(maxsize=4)  # both masks are of one ring
    def found(data: bytes, shape: tuple, dtype: str):
        return find_ring(np.frombuffer(data, dtype).reshape(shape), port, detectors)

    def ring_of(image):
        return found(image.tobytes(), image.shape, image.dtype.str)

    def ring(image: np.ndarray) -> np.ndarray:
        shape, found_px = image.shape[:2], ring_of(image)
        if found_px is None:
            return np.zeros(shape, np.float32)
        inner, outer = (_inside(shape, found_px, radius) for radius in edges(port))
        return (outer & ~inner).astype(np.float32)

    def markers(image: np.ndarray) -> np.ndarray:
        shape, found_px = image.shape[:2], ring_of(image)
        if found_px is None or not (inside := _inside(shape, found_px, REACH)).any():
            return np.zeros(shape, np.float32)
        if image.ndim == 3:
            mask = bright(image, inside)
        else:
            scale = found_px[2] * found_px[3] / port.ring_radius_m**2  # pixels in a square metre of its plane
            mask = enclosed(image, inside, scale * np.prod(port.marker_size_m))
        return cv2.GaussianBlur(mask, (0, 0), 0.7)

    return ring, markers


def edges(port: Port) -> np.ndarray:
    """Radii (2,) of the ring's edges, in that of its centre line."""
    return np.array([port.ring_inner_radius_m, port.ring_outer_radius_m]) / port.ring_radius_m


def grey(image: np.ndarray) -> np.ndarray:
    """(H, W) u8 of a frame, by the root of its light as noise is then alike everywhere, or of a histogram."""
    image = np.asarray(image, np.float32)
    if image.ndim == 3:
        return np.sqrt(255 * image.mean(-1)).astype(np.uint8)
    return cv2.GaussianBlur(np.minimum(image, SATURATED) * (255 / SATURATED), (0, 0), 0.8).astype(np.uint8)


def find_ring(image: np.ndarray, port: Port, detectors=DETECTORS) -> np.ndarray | None:
    """The ring's centre line as (u, v, semi-axis, semi-axis, angle of the first in rad), pixels; None where
    nothing looks like a ring."""
    radii = edges(port)
    strength = np.minimum(outline.edges(image), STRONGEST)
    found = []
    if "contours" in detectors:
        found += [by_contours(image) / [1, 1, r, r, 1] for r in radii]  # it may be either edge
    if "templates" in detectors:
        found.append(by_templates(strength, radii))
    if not len(middle := np.concatenate(found)):
        return None
    for blur_px in BLURS_PX:
        blurred = cv2.GaussianBlur(strength, (0, 0), blur_px) if blur_px else strength
        scores = ring_scores(blurred, middle, radii)
        middle = middle[np.argsort(-scores, kind="stable")[:KEPT]]
        middle = np.array([_climb(blurred, one, max(blur_px, 0.5), radii) for one in middle])
    scores = ring_scores(strength, middle, radii)
    return middle[scores.argmax()] if scores.max() > LEAST_SCORE else None


def by_contours(image: np.ndarray) -> np.ndarray:
    """Ellipses (N, 5), as `find_ring` has them, through contours of Canny's edges and of what is brighter
    than some level, of plausible size and shape."""
    values = grey(image)
    smooth = cv2.GaussianBlur(values, (0, 0), 1.0)
    levels = np.unique(np.quantile(smooth, np.linspace(0.3, 0.98, LEVELS)))
    found = []
    for shape in (cv2.Canny(values, *CANNY), *((smooth > level).astype(np.uint8) for level in levels)):
        for contour in cv2.findContours(shape, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)[0]:
            if len(contour) >= LEAST_POINTS:
                centre, (minor, major), angle = cv2.fitEllipseDirect(contour)
                if OURS.min_axis_ratio * major < minor and SIZES_PX[0] < major / 2 < values.shape[0]:
                    found.append((*centre, minor / 2, major / 2, np.deg2rad(angle)))
    return np.array(found).reshape(-1, 5)


def by_templates(strength: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Ellipses (N, 5) where templates of a ring, `ring_scores` as a filter, answer most."""
    small = cv2.resize(strength, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), 1.0)
    found = []
    for size_px in np.geomspace(*SIZES_PX, TEMPLATES) / 2:
        reach = int(np.ceil(size_px * radii[1])) + 1
        for squeeze, angle in SHAPES:
            template = np.zeros((2 * reach + 1, 2 * reach + 1), np.float32)
            one = np.array([[reach, reach, size_px, size_px * squeeze, angle]])
            for scale, weight in ((radii[0], 0.5), (radii[1], 0.5), (1.0, -1.0)):
                at = np.rint(_points(one * [1, 1, scale, scale, 1])).astype(int).reshape(-1, 2)
                np.add.at(template, (at[:, 1], at[:, 0]), weight / ANGLES)
            answer = cv2.filter2D(small, -1, template, borderType=cv2.BORDER_CONSTANT)
            _, top, _, (u, v) = cv2.minMaxLoc(answer)
            found.append((top, 2 * u + 0.5, 2 * v + 0.5, 2 * size_px, 2 * size_px * squeeze, angle))
    return np.array(sorted(found, reverse=True))[:TEMPLATES, 1:]


def ring_scores(strength: np.ndarray, middle: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """How much stronger an image's `outline.edges` (H, W) are on both edges of rings (N, 5), by geometric
    mean, than between them, (N,).  ``radii`` (2,) are in those of the centre line."""
    inner, outer, between = (_along(strength, middle * [1, 1, s, s, 1]) for s in (*radii, 1.0))
    return np.sqrt(np.maximum(inner, 0) * np.maximum(outer, 0)) - between


def _along(strength, ellipses) -> np.ndarray:
    return np.nan_to_num(sample(strength, _points(ellipses))).mean(-1)


def _climb(strength, start, step_px: float, radii) -> np.ndarray:
    """The best of many neighbours of an ellipse (5,), in rounds that get narrower."""
    rng, best = np.random.default_rng(0), start
    for _ in range(ROUNDS):
        step = step_px * np.array([1, 1, 1, 1, 2 / best[2:4].mean()])
        near = np.vstack([best, best + step * rng.standard_normal((NEIGHBOURS, 5))])
        best, step_px = near[ring_scores(strength, near, radii).argmax()], SHRINK * step_px
    return best


def bright(frame: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Mask (H, W) of a frame's markers: the brightest of three classes (Otsu 1979) inside the ring (H, W)."""
    values = cv2.GaussianBlur(grey(frame), (0, 0), 0.8)
    if len(np.unique(values[inside])) < 3:
        return np.zeros(inside.shape, np.float32)
    return (inside & (values > threshold_multiotsu(values[inside], 3)[1])).astype(np.float32)


def enclosed(histogram: np.ndarray, inside: np.ndarray, area_px: float) -> np.ndarray:
    """Mask (H, W) of a histogram's markers: quiet spots of about a marker's area that lines of events enclose
    inside the ring (H, W).  Elsewhere it is `FAINT`, as an open outline encloses nothing, and the estimator
    then asks the image's edges."""
    events = cv2.GaussianBlur(np.minimum(histogram, SATURATED).astype(np.float32), (0, 0), 1.0)
    quiet = inside & (events <= np.quantile(events[inside], QUIET))
    _, spot, facts, _ = cv2.connectedComponentsWithStats(quiet.astype(np.uint8), connectivity=4)
    areas = facts[:, cv2.CC_STAT_AREA] / area_px
    chosen = (areas > MARKER_AREAS[0]) & (areas < MARKER_AREAS[1]) & (np.arange(len(areas)) > 0)
    return np.maximum(cv2.dilate(chosen[spot].astype(np.float32), np.ones((3, 3))), FAINT * inside)


def _points(ellipses: np.ndarray) -> np.ndarray:
    """Points (N, ANGLES, 2) on ellipses (N, 5)."""
    u, v, a, b, angle = np.asarray(ellipses, float).T[..., None]
    s = np.linspace(0, 2 * np.pi, ANGLES, endpoint=False)
    x, y = a * np.cos(s), b * np.sin(s)
    return np.stack(
        [u + x * np.cos(angle) - y * np.sin(angle), v + x * np.sin(angle) + y * np.cos(angle)], -1
    )


def _inside(shape: tuple[int, int], ellipse: np.ndarray, factor: float) -> np.ndarray:
    """Pixels (H, W) inside a scaled ellipse (5,)."""
    u, v, a, b, angle = ellipse
    y, x = np.mgrid[: shape[0], : shape[1]] - np.array([v, u])[:, None, None]
    along, across = x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)
    return (along / a) ** 2 + (across / b) ** 2 <= factor**2
