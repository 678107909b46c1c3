"""EMVS: a semi-dense depth map from the counts of a space sweep (Rebecq et al., IJCV 2018); see `sweep`."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit

from .constants import Constants


@dataclass(frozen=True)
class DepthMap:
    """Semi-dense: ``depth (H, W)`` along the reference's axis, 0 where unknown; ``confidence (H, W)``."""

    depth: np.ndarray
    confidence: np.ndarray

    def points(self, K: np.ndarray) -> np.ndarray:
        """Points in the reference camera's frame, (N, 3)."""
        v, u = np.nonzero(self.depth)
        rays = np.stack([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], np.ones(len(u))], -1)
        return rays * self.depth[v, u, None]


def extract(dsi: np.ndarray, planes_inverse_depth: np.ndarray, constants: Constants) -> DepthMap:
    """Depth of the largest count in each pixel, where that stands out (EMVS, section on scene structure).

    An adaptive Gaussian threshold on the confidence (the largest count) selects pixels, a median filter
    smooths their depth, and points without neighbours of like depth are removed.  Beyond the papers, a pixel
    is selected only if its profile over the planes is a peak: on both sides of the maximum the count falls
    below a share of it.  An edge along the camera's motion has no such peak, and its maximum lies anywhere,
    often in the grid's last plane.
    """
    confidence, plane = _maximum(dsi)
    grey = confidence * (255 / max(float(confidence.max()), 1e-9))
    size = constants.threshold_window_px
    selected = grey > cv2.GaussianBlur(grey, (size, size), 0) + constants.threshold_offset
    _keep_peaks(selected, dsi, confidence, plane, constants.peak_share)
    step = planes_inverse_depth[1] - planes_inverse_depth[0]
    inverse = np.where(selected, planes_inverse_depth[0] + plane * step, 0)
    inverse = _median(inverse, constants.median_window_px // 2)
    inverse = _clean(inverse, constants.cleaning_radius_px, constants.cleaning_neighbours,
                     constants.cleaning_depth_ratio)  # fmt: skip
    depth = np.divide(1, inverse, out=np.zeros_like(inverse), where=inverse > 0)
    return DepthMap(depth, confidence)


def clean(depth: DepthMap, constants: Constants) -> DepthMap:
    """The map that is kept: without points that few others of like depth stand beside.

    Tracking has use for isolated points, a model of the scene has not.
    """
    inverse = np.divide(1, depth.depth, out=np.zeros_like(depth.depth), where=depth.depth > 0)
    kept = _clean(inverse, constants.cleaning_radius_px, constants.map_neighbours, constants.map_depth_ratio)
    return DepthMap(np.where(kept > 0, depth.depth, 0), depth.confidence)


@njit(cache=True, nogil=True)
def _keep_peaks(selected, dsi, largest, plane, share):
    """Unselect pixels whose profile does not fall below ``share`` of its maximum on both sides."""
    planes, height, width = dsi.shape
    for r in range(height):
        for c in range(width):
            if selected[r, c]:
                low, high = share * largest[r, c], int(np.rint(plane[r, c]))
                near = far = high
                while near >= 0 and dsi[near, r, c] > low:
                    near -= 1
                while far < planes and dsi[far, r, c] > low:
                    far += 1
                selected[r, c] = near >= 0 and far < planes


@njit(cache=True, nogil=True)
def _maximum(dsi):
    """Largest count of each pixel and its plane, to a fraction by the parabola through its neighbours."""
    planes, height, width = dsi.shape
    best, at = np.zeros((height, width), np.float32), np.zeros((height, width))
    for r in range(height):
        which = np.zeros(width, np.int64)
        for i in range(planes):
            for c in range(width):
                if dsi[i, r, c] > best[r, c]:
                    best[r, c], which[c] = dsi[i, r, c], i
        for c in range(width):
            i = which[c]
            at[r, c] = i
            if 0 < i < planes - 1:
                below, above = dsi[i - 1, r, c], dsi[i + 1, r, c]
                curvature = below - 2 * best[r, c] + above
                if curvature < 0:
                    at[r, c] += 0.5 * (below - above) / curvature
    return best, at


@njit(cache=True, nogil=True)
def _median(values, radius):
    """Median of the positive values around each positive one."""
    height, width = values.shape
    out = np.zeros_like(values)
    for r in range(height):
        around = np.empty((2 * radius + 1) ** 2)
        for c in range(width):
            if values[r, c] <= 0:
                continue
            n = 0
            for i in range(max(r - radius, 0), min(r + radius + 1, height)):
                for j in range(max(c - radius, 0), min(c + radius + 1, width)):
                    if values[i, j] > 0:
                        around[n] = values[i, j]
                        n += 1
            out[r, c] = np.median(around[:n])
    return out


@njit(cache=True, nogil=True)
def _clean(inverse, radius, neighbours, ratio):
    """Without points that have fewer than ``neighbours`` of like depth within ``radius`` pixels."""
    height, width = inverse.shape
    out = np.zeros_like(inverse)
    for r in range(height):
        for c in range(width):
            if inverse[r, c] <= 0:
                continue
            n = -1
            for i in range(max(r - radius, 0), min(r + radius + 1, height)):
                for j in range(max(c - radius, 0), min(c + radius + 1, width)):
                    close = abs(inverse[i, j] - inverse[r, c]) <= ratio * inverse[r, c]
                    n += inverse[i, j] > 0 and close
            if n >= neighbours:
                out[r, c] = inverse[r, c]
    return out
