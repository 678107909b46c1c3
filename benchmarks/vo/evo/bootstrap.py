"""EVO's start: a first map laid on a plane, which is fronto-parallel or follows from a homography.

The homography between two event frames is ``H = K (R + t n^T / d) K^-1`` for points of the plane
``n^T X = d`` in the first camera.  Its decomposition gives the plane up to scale.
"""

from __future__ import annotations

import cv2
import numpy as np

from .constants import Constants
from .event_frames import event_frame


def homography(first, second, guess, constants: Constants) -> tuple[np.ndarray, float]:
    """Homography (3, 3) that takes pixels of the first frame to the second, and the frames' correlation.

    The correlation is 0 where the alignment does not converge.
    """
    kind = cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS
    criteria = kind, constants.homography_iterations, constants.homography_tolerance
    try:
        correlation, H = cv2.findTransformECC(
            first, second, guess.astype(np.float32), cv2.MOTION_HOMOGRAPHY, criteria, None, 5
        )
    except cv2.error:  # its way to say that the images are uncorrelated
        return guess, 0.0
    return H.astype(float), float(correlation)


def plane(H, K, size_px) -> np.ndarray | None:
    """Normal over distance ``n / d`` (3,) of the plane that a homography belongs to, in units of ``|t|``.

    Of the solutions that lie in front of the camera in the whole image, the one that faces it most; None if
    there is none, or no translation.
    """
    _, _, translations, normals = cv2.decomposeHomographyMat(H, K)
    width, height = size_px
    corners = np.array([[0, 0, 1], [width, 0, 1], [0, height, 1], [width, height, 1.0]])
    rays = np.linalg.solve(K, corners.T)
    found = [n.ravel() * np.linalg.norm(t) for n, t in zip(normals, translations, strict=True)]
    ahead = [n for n in found if (n @ rays).min() > 1e-6]
    return max(ahead, key=lambda n: n[2] / np.linalg.norm(n), default=None)


def planar_depth(x, y, start: int, K, size_px, constants: Constants) -> np.ndarray:
    """Depth (H, W) of the plane under the frame of the events from ``start`` on; 1 in the middle.

    Frames are aligned one after the other with the first, until points have moved by
    ``homography_shift_px``.  If that fails on the way, the plane is fronto-parallel.
    """
    c, (width, height) = constants, size_px
    ones, H = np.ones((height, width)), np.eye(3)

    def frame(begin):
        events = slice(begin, begin + c.events_per_frame)
        return event_frame(x[events], y[events], size_px, c.count_limit, c.homography_blur_px)

    first, grid = frame(start), np.mgrid[20:height:20, 20:width:20].reshape(2, -1)[::-1].T.astype(float)
    for k in range(1, c.homography_frames):
        begin = start + k * c.events_per_frame
        if begin + c.events_per_frame > len(x):
            return ones
        H, correlation = homography(first, frame(begin), H, c)
        if correlation < c.homography_correlation:
            return ones
        moved = cv2.perspectiveTransform(grid[None], H)[0] - grid
        if np.linalg.norm(moved, axis=1).mean() > c.homography_shift_px:
            break
    else:
        return ones
    normal = plane(H, K, size_px)
    if normal is None:
        return ones
    v, u = np.mgrid[:height, :width]
    inverse = np.stack([u, v, np.ones_like(u)], -1) @ np.linalg.inv(K).T @ normal
    middle = inverse[height // 2, width // 2]
    steepest = c.nearest_plane, c.farthest_plane  # what the space sweep can still correct
    return np.clip(middle / inverse, *steepest)
