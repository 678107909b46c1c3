"""Values of images at points of bodies whose poses are known."""

from __future__ import annotations

import cv2
import numpy as np

from ..types import Camera, Pose
from .projection import project


def project_points(T_cam_body: Pose, points_m, camera: Camera) -> np.ndarray:
    """Points (*P, 3) of bodies in poses (*B,) in pixels, (*B, *P, 2); NaN behind the camera."""
    R, p = T_cam_body.rotation, T_cam_body.position_m
    points = np.asarray(points_m)
    flat = R @ points.reshape(-1, 3).T + p[..., None]  # components apart, as `project` wants them
    return project(np.moveaxis(flat, -2, -1), camera).reshape(*p.shape[:-1], *points.shape[:-1], 2)


def sample(image, points_px) -> np.ndarray:
    """Bilinear values of an image (H, W) at points (..., N, 2), zero outside it and behind the camera."""
    with np.errstate(over="ignore"):  # just before the camera pixels are as far away as numbers go
        grid = np.asarray(points_px).astype(np.float32).reshape(-1, points_px.shape[-2], 2)
    np.fmin(np.fmax(grid, -10, out=grid), 30_000, out=grid)  # of NaN and -10, -10
    image = np.asarray(image, np.float32)
    return cv2.remap(image, grid, None, cv2.INTER_LINEAR, borderValue=0.0).reshape(points_px.shape[:-1])
