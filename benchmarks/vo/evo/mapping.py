"""EMVS: a semi-dense depth map from events with known poses, by a space sweep (Rebecq et al., IJCV 2018).

Each event is a ray.  Rays are counted where they cross the planes of a projective grid in front of a
reference camera (the disparity space image, DSI); scene edges lie where many of them meet.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit, prange

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


def inverse_depths(nearest: float, farthest: float, planes: int) -> np.ndarray:
    """Inverse depths of the DSI's planes, uniform, nearest plane first."""
    return np.linspace(1 / nearest, 1 / farthest, planes)


def space_sweep(x, y, rotation, position, K, size_px, planes_inverse_depth, packet_events: int) -> np.ndarray:
    """The DSI: ray counts with bilinear votes, (planes, H, W) float32.

    Parameters
    ----------
    x, y
        Pixels of events, (N,), in the order of time.
    rotation, position
        ``T_ref_cam`` of each packet of ``packet_events`` events, (P, 3, 3) and (P, 3).
    K, size_px
        Intrinsic matrix of both cameras; width and height of the reference image.
    planes_inverse_depth
        (planes,) of the reference camera.
    """
    dsi = np.zeros((len(planes_inverse_depth), size_px[1], size_px[0]), np.float32)
    slopes = np.empty((len(x), 2), np.float32)
    _slopes(slopes, x, y, rotation, K, packet_events)
    _vote(dsi, slopes, np.ascontiguousarray(position, float), K, planes_inverse_depth, packet_events)
    return dsi


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


@njit(cache=True, parallel=True)
def _keep_peaks(selected, dsi, largest, plane, share):
    """Unselect pixels whose profile does not fall below ``share`` of its maximum on both sides."""
    planes, height, width = dsi.shape
    for r in prange(height):
        for c in range(width):
            if selected[r, c]:
                low, high = share * largest[r, c], int(np.rint(plane[r, c]))
                near = far = high
                while near >= 0 and dsi[near, r, c] > low:
                    near -= 1
                while far < planes and dsi[far, r, c] > low:
                    far += 1
                selected[r, c] = near >= 0 and far < planes


@njit(cache=True, parallel=True, error_model="numpy")
def _slopes(slopes, x, y, rotation, K, packet):
    """Directions of the rays in the reference camera, x/z and y/z; NaN for those that look backward."""
    for p in prange((len(x) + packet - 1) // packet):
        R = rotation[p]
        for k in range(p * packet, min((p + 1) * packet, len(x))):
            a, b = (x[k] - K[0, 2]) / K[0, 0], (y[k] - K[1, 2]) / K[1, 1]
            z = R[2, 0] * a + R[2, 1] * b + R[2, 2]
            if z < 0.1:
                z = np.nan
            slopes[k, 0] = (R[0, 0] * a + R[0, 1] * b + R[0, 2]) / z
            slopes[k, 1] = (R[1, 0] * a + R[1, 1] * b + R[1, 2]) / z


@njit(cache=True, parallel=True, fastmath={"nsz", "arcp", "contract", "reassoc"}, error_model="numpy")
def _vote(dsi, slopes, centre, K, inverse_depth, packet):
    """With camera centre C and slope s, a ray crosses depth Z at X/Z = C_xy / Z + (1 - C_z / Z) s."""
    height, width = dsi.shape[1:]
    right, bottom = np.float32(width - 1), np.float32(height - 1)
    for i in prange(len(inverse_depth)):
        plane = dsi[i]
        for p in range(len(centre)):
            share = 1 - centre[p, 2] * inverse_depth[i]
            if share <= 0.05:
                continue  # the plane is behind this camera, or almost
            fu, fv = np.float32(K[0, 0] * share), np.float32(K[1, 1] * share)
            cu = np.float32(K[0, 0] * centre[p, 0] * inverse_depth[i] + K[0, 2])
            cv = np.float32(K[1, 1] * centre[p, 1] * inverse_depth[i] + K[1, 2])
            for k in range(p * packet, min((p + 1) * packet, len(slopes))):
                u, v = fu * slopes[k, 0] + cu, fv * slopes[k, 1] + cv
                if u >= 0 and v >= 0 and u < right and v < bottom:
                    c, r = np.int32(u), np.int32(v)
                    a, b = u - c, v - r
                    top, low = plane[r], plane[r + 1]
                    top[c] += (1 - a) * (1 - b)
                    top[c + 1] += a * (1 - b)
                    low[c] += (1 - a) * b
                    low[c + 1] += a * b


@njit(cache=True, parallel=True)
def _maximum(dsi):
    """Largest count of each pixel and its plane, to a fraction by the parabola through its neighbours."""
    planes, height, width = dsi.shape
    best, at = np.zeros((height, width), np.float32), np.zeros((height, width))
    for r in prange(height):
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


@njit(cache=True, parallel=True)
def _median(values, radius):
    """Median of the positive values around each positive one."""
    height, width = values.shape
    out = np.zeros_like(values)
    for r in prange(height):
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


@njit(cache=True, parallel=True)
def _clean(inverse, radius, neighbours, ratio):
    """Without points that have fewer than ``neighbours`` of like depth within ``radius`` pixels."""
    height, width = inverse.shape
    out = np.zeros_like(inverse)
    for r in prange(height):
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
