"""Projection into a camera's pixels and back, with and without lens distortion."""

from __future__ import annotations

import cv2
import numpy as np

from ..types import Camera

WIDEST_RAD = np.deg2rad(89.0)  # off the axis: a fisheye sees further, a plane before the lens does not


def bearings(points_px, camera: Camera) -> np.ndarray:
    """Undistorted directions (x, y, 1) of pixels, (..., 2) -> (..., 3); at most `WIDEST_RAD` off the axis."""
    points = np.asarray(points_px, float)
    xy = (points - [camera.cx_px, camera.cy_px]) / [camera.fx_px, camera.fy_px]
    if camera.distortion and camera.distortion_model == "equidistant":
        xy = _undistort_equidistant(xy, camera.distortion)
    elif camera.distortion and points.size:
        flat = cv2.undistortPointsIter(
            points.reshape(-1, 1, 2), camera.K, np.array(camera.distortion), None, None,
            (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12),
        )  # fmt: skip
        xy = flat.reshape(points.shape)
    return np.concatenate([xy, np.ones_like(xy[..., :1])], -1)


def project(points_m, camera: Camera) -> np.ndarray:
    """Pixels of points in the camera frame, (..., 3) -> (..., 2); NaN behind the camera."""
    points = np.asarray(points_m, float)
    z = np.where(points[..., 2] > 0, points[..., 2], np.nan)
    x, y = points[..., 0] / z, points[..., 1] / z
    if camera.distortion:
        x, y = np.moveaxis(distort(np.stack([x, y], -1), camera), -1, 0)
    pixels = np.empty((*z.shape, 2))
    pixels[..., 0], pixels[..., 1] = x * camera.fx_px + camera.cx_px, y * camera.fy_px + camera.cy_px
    return pixels


def distort(xy, camera: Camera) -> np.ndarray:
    """The lens's distortion of normalised coordinates, (..., 2) -> (..., 2)."""
    if not camera.distortion:
        return xy
    if camera.distortion_model == "equidistant":
        r = np.hypot(xy[..., 0], xy[..., 1])
        ratio = _angle_on_image(np.arctan(r), camera.distortion) / np.where(r > 0, r, 1)
        return xy * np.where(r > 0, ratio, 1)[..., None]
    k1, k2, p1, p2, k3 = (*camera.distortion, 0.0, 0.0, 0.0, 0.0, 0.0)[:5]
    x, y = xy[..., 0], xy[..., 1]
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        ],
        -1,
    )


def _angle_on_image(angle_rad, k) -> np.ndarray:
    """Kannala & Brandt's distance from the image's centre, in focal lengths, of rays (...) off the axis."""
    t2 = np.square(angle_rad)
    return angle_rad * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))))


def _undistort_equidistant(xy, k) -> np.ndarray:
    """Inverse of the equidistant `distort`, (..., 2) -> (..., 2), by Newton's method."""
    distance = np.hypot(xy[..., 0], xy[..., 1])
    angle = np.minimum(distance, WIDEST_RAD)
    for _ in range(20):
        t2 = angle * angle
        slope = 1 + t2 * (3 * k[0] + t2 * (5 * k[1] + t2 * (7 * k[2] + t2 * 9 * k[3])))
        step = (_angle_on_image(angle, k) - distance) / np.maximum(slope, 0.1)
        angle = np.clip(angle - step, 0, WIDEST_RAD)
    ratio = np.tan(angle) / np.where(distance > 0, distance, 1)
    return xy * np.where(distance > 0, ratio, 1)[..., None]


def undistort_points(points_px, camera: Camera) -> np.ndarray:
    """Pixels that the same camera without distortion would see, (..., 2) -> (..., 2)."""
    if not camera.distortion:
        return np.asarray(points_px, float)
    xy = bearings(points_px, camera)[..., :2]
    return xy * [camera.fx_px, camera.fy_px] + [camera.cx_px, camera.cy_px]


def distort_points(points_px, camera: Camera) -> np.ndarray:
    """Inverse of `undistort_points`: where the camera sees them, (..., 2) -> (..., 2)."""
    if not camera.distortion:
        return np.asarray(points_px, float)
    centre, focal = [camera.cx_px, camera.cy_px], [camera.fx_px, camera.fy_px]
    return distort((np.asarray(points_px, float) - centre) / focal, camera) * focal + centre


def rescale_px(points_px, scale: float) -> np.ndarray:
    """Pixels of the same image resampled by ``scale``: centres stay centres."""
    return (np.asarray(points_px, float) + 0.5) * scale - 0.5
