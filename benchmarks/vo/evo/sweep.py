"""EMVS's space sweep: how many events' rays cross each cell of a grid (Rebecq et al., IJCV 2018).

Each event is a ray.  Rays are counted where they cross the planes of a projective grid in front of a
reference camera (the disparity space image, DSI); scene edges lie where many of them meet.
"""

from __future__ import annotations

import numpy as np
from numba import njit


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
    dsi = np.empty((len(planes_inverse_depth), size_px[1], size_px[0]), np.float32)
    slopes = np.empty((2, len(x)), np.float32)
    _slopes(slopes, x, y, rotation, K, packet_events)
    _vote(dsi, slopes, np.ascontiguousarray(position, float), K, planes_inverse_depth, packet_events)
    return dsi


@njit(cache=True, nogil=True, error_model="numpy")
def _slopes(slopes, x, y, rotation, K, packet):
    """Directions of the rays in the reference camera, x/z and y/z; NaN for those that look backward."""
    for p in range((len(x) + packet - 1) // packet):
        R = rotation[p]
        for k in range(p * packet, min((p + 1) * packet, len(x))):
            a, b = (x[k] - K[0, 2]) / K[0, 0], (y[k] - K[1, 2]) / K[1, 1]
            z = R[2, 0] * a + R[2, 1] * b + R[2, 2]
            if z < 0.1:
                z = np.nan
            slopes[0, k] = (R[0, 0] * a + R[0, 1] * b + R[0, 2]) / z
            slopes[1, k] = (R[1, 0] * a + R[1, 1] * b + R[1, 2]) / z


@njit(cache=True, nogil=True, fastmath={"nsz", "arcp", "contract", "reassoc"}, error_model="numpy")
def _vote(dsi, slopes, centre, K, inverse_depth, packet):
    """With camera centre C and slope s, a ray crosses depth Z at X/Z = C_xy / Z + (1 - C_z / Z) s.

    First where a packet's rays cross, which the processor does for many at once, then their bilinear votes.
    """
    planes, height, width = dsi.shape
    outside, one, row = height * width, np.uint32(1), np.uint32(width)  # a bin behind the image
    counts = np.empty(outside + width + 2, np.float32)
    at, right, down = np.empty(packet, np.uint32), np.empty(packet, np.float32), np.empty(packet, np.float32)
    last_u, last_v = np.float32(width - 1), np.float32(height - 1)
    for i in range(planes):
        counts[:] = 0
        for p in range(len(centre)):
            share = 1 - centre[p, 2] * inverse_depth[i]
            if share <= 0.05:
                continue  # the plane is behind this camera, or almost
            fu, fv = np.float32(K[0, 0] * share), np.float32(K[1, 1] * share)
            cu = np.float32(K[0, 0] * centre[p, 0] * inverse_depth[i] + K[0, 2])
            cv = np.float32(K[1, 1] * centre[p, 1] * inverse_depth[i] + K[1, 2])
            first = p * packet
            size = min(packet, slopes.shape[1] - first)
            for k in range(size):
                u, v = fu * slopes[0, first + k] + cu, fv * slopes[1, first + k] + cv
                inside = (u >= 0) & (v >= 0) & (u < last_u) & (v < last_v)
                c, r = np.int32(u), np.int32(v)
                at[k] = r * width + c if inside else outside
                right[k] = u - c if inside else np.float32(0)
                down[k] = v - r if inside else np.float32(0)
            for k in range(size):
                a, b, n = right[k], down[k], at[k]
                counts[n] += (1 - a) * (1 - b)
                counts[n + one] += a * (1 - b)
                counts[n + row] += (1 - a) * b
                counts[n + row + one] += a * b
        dsi[i].reshape(-1)[:] = counts[:outside]
