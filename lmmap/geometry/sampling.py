"""Interpolation of images between pixels."""

from __future__ import annotations

import cv2
import numpy as np

from ..types import Camera
from .projection import distort_points


def sample(image, points_px) -> np.ndarray:
    """Bilinear values of an image (H, W) at points (..., N, 2), zero outside it and behind the camera."""
    with np.errstate(over="ignore"):  # just before the camera pixels are as far away as numbers go
        grid = np.asarray(points_px).astype(np.float32).reshape(-1, points_px.shape[-2], 2)
    np.fmin(np.fmax(grid, -10, out=grid), 30_000, out=grid)  # of NaN and -10, -10
    image = np.asarray(image, np.float32)
    values = cv2.remap(image, grid, None, cv2.INTER_LINEAR, borderValue=0.0)  # type: ignore[call-overload]
    return values.reshape(points_px.shape[:-1])


def profiles(image, points_px, directions, offsets_px, camera: Camera | None = None) -> np.ndarray:
    """Values (N, K) of an image (H, W) at offsets (K,) from points (N, 2) along directions (N, 2), in px.

    If a camera is given, the points are undistorted, and the image has the camera's distortion.
    """
    uv = [points_px[:, i, None] + offsets_px * directions[:, i, None] for i in (0, 1)]
    grid = np.stack(uv, -1)
    return sample(image, distort_points(grid, camera) if camera else grid)
