"""Projection into a camera's pixels and back, with and without lens distortion."""

from __future__ import annotations

import cv2
import numpy as np

from ..types import Camera, Pose
from .compiled import njit

WIDEST_RAD = np.deg2rad(89.0)  # off the axis: a fisheye sees further, a plane before the lens does not


def bearings(points_px, camera: Camera) -> np.ndarray:
    """Undistorted directions (x, y, 1) of pixels, (..., 2) -> (..., 3); at most `WIDEST_RAD` off the axis."""
    points = np.asarray(points_px, float)
    xy = (points - [camera.cx_px, camera.cy_px]) / [camera.fx_px, camera.fy_px]
    if camera.distortion and camera.distortion_model == "equidistant":
        xy = _undistort_equidistant(xy, camera.distortion)
    elif camera.distortion and points.size:
        flat = cv2.undistortPointsIter(  # type: ignore[call-overload]  # its types know no None
            points.reshape(-1, 1, 2), camera.K, np.array(camera.distortion), None, None,
            (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12),
        )  # fmt: skip
        xy = flat.reshape(points.shape)
    return np.concatenate([xy, np.ones_like(xy[..., :1])], -1)


def project(points_m, camera: Camera) -> np.ndarray:
    """Pixels of points in the camera frame, (..., 3) -> (..., 2); NaN behind the camera."""
    points = np.array(points_m, float, order="C")
    pixels = _pixels(np.eye(3)[None], np.zeros((1, 3)), points.reshape(-1, 3), *_lens(camera))
    return pixels.reshape(*points.shape[:-1], 2)


def project_points(T_cam_body: Pose, points_m, camera: Camera) -> np.ndarray:
    """Project points (*P, 3) of bodies at poses (*B,) into pixels, (*B, *P, 2); NaN behind the camera."""
    R, p = (np.array(part, order="C") for part in (T_cam_body.rotation, T_cam_body.position_m))
    points = np.array(points_m, float, order="C")
    pixels = _pixels(R.reshape(-1, 3, 3), p.reshape(-1, 3), points.reshape(-1, 3), *_lens(camera))
    return pixels.reshape(*p.shape[:-1], *points.shape[:-1], 2)


def distort(xy, camera: Camera) -> np.ndarray:
    """Apply the lens's distortion to normalised coordinates, (..., 2) -> (..., 2)."""
    if not camera.distortion:
        return xy
    xy = np.array(xy, float, order="C")
    return _distort(xy.reshape(-1, 2), *_lens(camera)[1:]).reshape(xy.shape)


def _lens(camera: Camera) -> tuple[tuple, tuple, bool]:
    """Focal lengths and centre (4,), coefficients (5,) of the distortion, and whether it is equidistant."""
    intrinsics = float(camera.fx_px), float(camera.fy_px), float(camera.cx_px), float(camera.cy_px)
    coefficients = tuple(float(k) for k in (*camera.distortion, 0, 0, 0, 0, 0)[:5])
    return intrinsics, coefficients, bool(camera.distortion) and camera.distortion_model == "equidistant"


@njit(nogil=True, error_model="numpy")
def _pixels(R, p, points_m, intrinsics, k, equidistant):
    """Pixels (B, P, 2) of points (P, 3) in poses R (B, 3, 3) and p (B, 3)."""
    fx, fy, cx, cy = intrinsics
    pixels = np.empty((len(R), len(points_m), 2))
    for b in range(len(R)):
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = R[b, 0], R[b, 1], R[b, 2]
        px, py, pz = p[b]
        for i in range(len(points_m)):
            X, Y, Z = points_m[i]
            z = zx * X + zy * Y + zz * Z + pz
            z = z if z > 0 else np.nan
            x, y = (xx * X + xy * Y + xz * Z + px) / z, (yx * X + yy * Y + yz * Z + py) / z
            x, y = _distorted(x, y, k, equidistant)
            pixels[b, i, 0], pixels[b, i, 1] = x * fx + cx, y * fy + cy
    return pixels


@njit(nogil=True, error_model="numpy")
def _distort(xy, k, equidistant):
    distorted = np.empty_like(xy)
    for i in range(len(xy)):
        distorted[i] = _distorted(xy[i, 0], xy[i, 1], k, equidistant)
    return distorted


@njit(nogil=True, error_model="numpy")
def _distorted(x, y, k, equidistant):
    """Of normalised coordinates, by Brown's model k1, k2, p1, p2, k3 or by `_angle_on_image`."""
    if equidistant:
        r = np.hypot(x, y)
        ratio = _one_angle_on_image(np.arctan(r), k) / r if r > 0 else 1.0
        return x * ratio, y * ratio
    r2 = x * x + y * y
    radial = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))
    return (
        x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x),
        y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y,
    )


def _angle_on_image(angle_rad, k) -> np.ndarray:
    """Kannala & Brandt's distance from the image's centre, in focal lengths, of rays (...) off the axis."""
    t2 = angle_rad * angle_rad
    return angle_rad * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))))


_one_angle_on_image = njit(nogil=True, error_model="numpy")(_angle_on_image)


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
    """Pixels as the same camera without distortion would see them, (..., 2) -> (..., 2)."""
    if not camera.distortion:
        return np.asarray(points_px, float)
    xy = bearings(points_px, camera)[..., :2]
    return xy * [camera.fx_px, camera.fy_px] + [camera.cx_px, camera.cy_px]


def distort_points(points_px, camera: Camera) -> np.ndarray:
    """Inverse of `undistort_points`: pixels as the camera with its lens sees them, (..., 2) -> (..., 2)."""
    if not camera.distortion:
        return np.asarray(points_px, float)
    centre, focal = [camera.cx_px, camera.cy_px], [camera.fx_px, camera.fy_px]
    return distort((np.asarray(points_px, float) - centre) / focal, camera) * focal + centre


def rescale_px(points_px, scale: float) -> np.ndarray:
    """Pixels (..., 2) in the same image resampled by ``scale``; pixel centres stay whole numbers."""
    return (np.asarray(points_px, float) + 0.5) * scale - 0.5
