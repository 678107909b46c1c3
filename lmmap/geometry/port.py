"""The port as a camera sees it: circles, points on its planes, its ideal masks, and whether it is in view."""

from __future__ import annotations

import numpy as np

from ..types import Camera, Port, Pose
from .projection import bearings, project


def circle_points_m(radius_m: float, count: int = 72) -> np.ndarray:
    """Points of a circle in its own frame, shape (count, 3)."""
    s = np.linspace(0, 2 * np.pi, count, endpoint=False)
    return radius_m * np.stack([np.cos(s), np.sin(s), np.zeros(count)], -1)


def in_view(T_cam_port: Pose, port: Port, camera: Camera) -> np.ndarray:
    """Whether the whole ring projects inside the image, for poses of any batch shape."""
    ring = circle_points_m(port.ring_outer_radius_m)
    points = project(np.einsum("...ij,kj->...ki", T_cam_port.rotation, ring)
                     + T_cam_port.position_m[..., None, :], camera)  # fmt: skip
    upper = np.array([camera.width_px, camera.height_px]) - 0.5
    with np.errstate(invalid="ignore"):
        inside = np.all((points >= -0.5) & (points < upper), (-2, -1))
    return inside & (np.sum(T_cam_port.normal * T_cam_port.position_m, -1) < 0)


def on_plane(points_px, T_cam_port: Pose, height_m: float, camera: Camera) -> np.ndarray:
    """Where lines of sight meet the port's plane z = height, (..., 2) px -> (..., 2) m; NaN if they don't."""
    T_port_cam = T_cam_port.inverse
    direction = bearings(points_px, camera) @ T_port_cam.rotation.T
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (height_m - T_port_cam.position_m[2]) / direction[..., 2]
    along = np.where((along > 0) & np.isfinite(along), along, np.nan)
    return T_port_cam.position_m[:2] + along[..., None] * direction[..., :2]


def ideal_masks(T_cam_port: Pose, port: Port, camera: Camera, samples: int = 4) -> np.ndarray:
    """Fraction of each pixel that ring and markers cover if nothing hides them, (2, H, W) f32.

    Each pixel is the mean over ``samples`` x ``samples`` lines of sight.
    """
    outline = np.concatenate([circle_points_m(port.ring_outer_radius_m), *port.marker_corners_m()])
    points = project(T_cam_port @ outline, camera)
    if np.isnan(points).any():  # partly behind the camera: no bounding box
        points = np.array([[0, 0], camera.size_px])
    low = (np.floor(points.min(0)).astype(int) - 1).clip(0, camera.size_px)
    high = (np.ceil(points.max(0)).astype(int) + 2).clip(low, camera.size_px)

    offsets = (np.arange(samples) + 0.5) / samples - 0.5
    u, v = (np.add.outer(np.arange(a, b), offsets).ravel() for a, b in zip(low, high, strict=True))
    pixels = np.stack(np.meshgrid(u, v), -1)
    radius = np.linalg.norm(on_plane(pixels, T_cam_port, 0.0, camera), axis=-1)
    ring = (radius >= port.ring_inner_radius_m) & (radius <= port.ring_outer_radius_m)

    xy = on_plane(pixels, T_cam_port, port.plate_height_m, camera)
    half = port.yaw_period_rad / 2
    angle = (np.arctan2(xy[..., 1], xy[..., 0]) + half) % port.yaw_period_rad - half  # into one sector
    distance = np.linalg.norm(xy, axis=-1)
    tangential, radial = np.array(port.marker_size_m) / 2
    in_depth = np.abs(distance * np.cos(angle) - port.marker_radius_m) <= radial
    markers = in_depth & (np.abs(distance * np.sin(angle)) <= tangential)

    width, height = high - low
    blocks = np.stack([ring, markers]).reshape(2, height, samples, width, samples)
    masks = np.zeros((2, camera.height_px, camera.width_px), np.float32)
    masks[:, low[1] : high[1], low[0] : high[0]] = blocks.mean((2, 4))
    return masks
