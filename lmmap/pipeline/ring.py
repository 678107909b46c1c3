"""From the ring's mask to its contour: binarisation with hysteresis, a skeleton one pixel wide, an ellipse
through it, and the middle of the mask's stroke along that ellipse.

If the ring is expected somewhere, it is traced from there; only if that fails is the mask searched.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from skimage.morphology import skeletonize

from ..geometry.conics import is_view
from ..geometry.projection import undistort_points
from ..refinement import contour
from ..refinement.contour import Contour
from ..settings import OURS, Settings
from ..types import Camera, Ellipse, Port, Status
from . import ellipse, local_search
from .setup import Setup

MAX_WIDTHS = 4.0  # of the image, that a ring's semi-axis may have: what is sampled along it takes memory


def find_ring(mask: np.ndarray, setup: Setup, near: Ellipse | None = None) -> Contour | Status:
    """Find the ring's contour in a mask (H, W), free of lens distortion, or return why it fails.

    Search first where the ring is expected, then among the mask's strong blobs and, if they hold none, in
    the whole mask.
    """
    camera, settings = setup.camera, setup.settings
    if near is not None and (ring := follow(near, mask, setup)):
        return ring
    for peak_share in (settings.peak_share, 0.0):
        points = skeleton_points(mask, settings.mask_threshold, peak_share)
        if len(points) < settings.min_ring_pixels:
            status = Status.NO_RING
            continue
        points = undistort_points(points, camera)
        fitted, inliers = find_ellipse(points, mask, camera, settings)
        if fitted is not None:
            break
        status = Status.NO_ELLIPSE
    else:
        return status
    ring = contour.trace(fitted, mask, strip_px(fitted, setup), camera, settings)
    if ring and not _is_ports(ring, setup):
        return Status.NO_ELLIPSE
    return _scored(ring or contour.from_points(fitted, points[inliers]), points, mask, camera)


def follow(expected: Ellipse, mask: np.ndarray, setup: Setup) -> Contour | None:
    """Trace the contour around the expected ellipse.  Return None if the mask by itself fails the checks that
    apply to any ring."""
    camera, settings = setup.camera, setup.settings
    ring = contour.trace(expected, mask, strip_px(expected, setup), camera, settings, rounds=(2,))
    if ring is None or not _is_ports(ring, setup):
        return None
    major, minor = ring.ellipse.semi_axes_px
    if minor < settings.min_axis_ratio * major or major < settings.min_semi_major_px:
        return None
    ring = _scored(ring, ring.points_px, mask, camera)
    if ring.arc_coverage < settings.min_arc_coverage:
        return None
    return ring if ring.score >= settings.min_arc_coverage * settings.mask_threshold else None


def _is_ports(ring: Contour, setup: Setup) -> bool:
    """Whether a traced ring is the view of a circle with a stroke hardly wider than the port's."""
    widest = setup.settings.widest_stroke * stroke(setup.port)
    assert ring.width is not None  # it was traced
    return ring.width <= widest and is_view(ring.ellipse, setup.camera)


def _scored(ring: Contour, points_px, mask, camera: Camera) -> Contour:
    """With the mask's mean along it, and its arc coverage by the ring's points (M, 2)."""
    score = contour.score(ring.ellipse, mask, camera)
    return replace(ring, score=score, arc_coverage=ellipse.arc_coverage(ring.ellipse, points_px))


def strip_px(ring: Ellipse, setup: Setup) -> float:
    """Half the width (px) of the strip around a ring's ellipse in which its stroke is searched."""
    return float(setup.settings.contour_half_width * (stroke(setup.port) * ring.semi_axes_px[0]))


def stroke(port: Port) -> float:
    """Width of the ring, in units of its radius."""
    return (port.ring_outer_radius_m - port.ring_inner_radius_m) / port.ring_radius_m


def find_ellipse(
    points_px, mask: np.ndarray, camera: Camera, settings: Settings = OURS
) -> tuple[Ellipse | None, np.ndarray]:
    """The ring's ellipse among a mask's points (M, 2), and which of them lie on it (M,)."""
    fitted, inliers = ellipse.fit_ransac(points_px, np.random.default_rng(0), settings)
    if fitted is None and settings.local_search:
        fitted, inliers = local_search.fit_local(points_px, mask, np.random.default_rng(0), camera, settings)
    if fitted is not None and not (
        is_view(fitted, camera) and fitted.semi_axes_px[0] <= MAX_WIDTHS * max(camera.size_px)
    ):
        return None, np.zeros(len(inliers), bool)
    return fitted, inliers


def binarise(mask, threshold: float = OURS.mask_threshold, peak_share: float = OURS.peak_share) -> np.ndarray:
    """Pixels (H, W) above the threshold in blobs that somewhere exceed ``peak_share`` times the mask's
    maximum.  This hysteresis drops weak blobs and keeps the weak ends of strong ones."""
    mask = np.asarray(mask, np.float32)
    high = peak_share * mask.max(initial=0)
    active = mask > threshold
    if high <= threshold:
        return active
    count, blob = cv2.connectedComponents(active.astype(np.uint8), connectivity=4)
    kept = np.zeros(count, bool)
    kept[blob[mask > high]] = True
    return kept[blob]


def skeleton_points(
    mask, threshold: float = OURS.mask_threshold, peak_share: float = OURS.peak_share
) -> np.ndarray:
    """Pixels (u, v), shape (M, 2), of the skeleton (Zhang & Suen 1984) of what `binarise` keeps: lines one
    pixel wide.

    Zhang's thinning of strokes of even width leaves them shifted by (-0.14, -0.14) px on average;
    `contour.trace` doesn't have that bias.
    """
    active = binarise(mask, threshold, peak_share)
    rows, columns = (np.flatnonzero(active.any(axis)) for axis in (1, 0))
    if not rows.size:
        return np.empty((0, 2))
    top, left = rows[0], columns[0]
    v, u = np.nonzero(skeletonize(active[top : rows[-1] + 1, left : columns[-1] + 1], method="zhang"))
    return np.column_stack([u + left, v + top]).astype(float)
