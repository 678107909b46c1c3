"""Projection, distortion, ellipse <-> conic, circles in space -> ellipses in the image.

Conics are symmetric (..., 3, 3) matrices C with x' C x = 0 for homogeneous pixels x = (u, v, 1).
"""

from __future__ import annotations

import cv2
import numpy as np

from ..types import Camera, Ellipse, Port, Pose


def bearings(points_px, camera: Camera) -> np.ndarray:
    """Undistorted directions (x, y, 1) of pixels, (..., 2) -> (..., 3)."""
    points = np.asarray(points_px, float)
    xy = (points - [camera.cx_px, camera.cy_px]) / [camera.fx_px, camera.fy_px]
    if camera.distortion and points.size:
        flat = cv2.undistortPointsIter(
            points.reshape(-1, 1, 2), camera.K, np.array(camera.distortion), None, None,
            (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12),
        )  # fmt: skip
        xy = flat.reshape(points.shape)
    return np.concatenate([xy, np.ones_like(xy[..., :1])], -1)


def unproject(points_px, depth_m, camera: Camera) -> np.ndarray:
    """Points in the camera frame at the given depths, (..., 2), (...) -> (..., 3)."""
    return bearings(points_px, camera) * np.asarray(depth_m, float)[..., None]


def project(points_m, camera: Camera) -> np.ndarray:
    """Pixels of points in the camera frame, (..., 3) -> (..., 2); NaN behind the camera."""
    x, y, z = np.moveaxis(np.asarray(points_m, float), -1, 0)
    z = np.where(z > 0, z, np.nan)
    x, y = np.moveaxis(distort(np.stack([x / z, y / z], -1), camera), -1, 0)
    return np.stack([x * camera.fx_px + camera.cx_px, y * camera.fy_px + camera.cy_px], -1)


def distort(xy, camera: Camera) -> np.ndarray:
    """Radial-tangential distortion of normalised coordinates, (..., 2) -> (..., 2)."""
    if not camera.distortion:
        return xy
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


def conic_from_ellipse(ellipse: Ellipse) -> np.ndarray:
    """Conic matrices of ellipses, with unit Frobenius norm and positive definite upper block."""
    c, s = np.cos(ellipse.angle_rad), np.sin(ellipse.angle_rad)
    R = np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)
    A = np.einsum("...ij,...j,...kj->...ik", R, ellipse.semi_axes_px**-2.0, R)
    b = -np.einsum("...ij,...j->...i", A, ellipse.centre_px)
    f = -np.einsum("...i,...i->...", b, ellipse.centre_px) - 1
    return _conic(A, b, f)


def _conic(A, b, f) -> np.ndarray:
    top = np.concatenate([A, b[..., :, None]], -1)
    bottom = np.concatenate([b, f[..., None]], -1)[..., None, :]
    C = np.concatenate([top, bottom], -2)
    return C / np.linalg.norm(C, axis=(-2, -1), keepdims=True)


def ellipse_from_conic(conic) -> tuple[Ellipse, np.ndarray]:
    """Ellipses of conics (..., 3, 3), and which of them are real ellipses (...), the rest being NaN.

    Eliminating the linear term gives the centre c = -A^-1 b; then (x-c)' A (x-c) = -f - b'c.
    """
    C = np.asarray(conic, float)
    with np.errstate(all="ignore"):
        C = C * np.sign(C[..., 0, 0] + C[..., 1, 1])[..., None, None]
        A, b, f = C[..., :2, :2], C[..., :2, 2], C[..., 2, 2]
        a11, a12, a22 = A[..., 0, 0], A[..., 0, 1], A[..., 1, 1]
        det = a11 * a22 - a12**2
        centre = np.stack([a12 * b[..., 1] - a22 * b[..., 0], a12 * b[..., 0] - a11 * b[..., 1]], -1)
        centre = centre / det[..., None]
        gain = -f - np.sum(b * centre, -1)
        mean, half = (a11 + a22) / 2, np.hypot((a11 - a22) / 2, a12)
        axes = np.sqrt(np.stack([gain * (mean + half) / det, gain / (mean + half)], -1))
        angle = 0.5 * np.arctan2(-2 * a12, a22 - a11)
    real = (det > 0) & np.all(np.isfinite(axes) & (axes > 0), -1) & np.all(np.isfinite(centre), -1)
    angle = np.where(real, angle, np.nan)
    axes = np.where(real[..., None], axes, np.nan)
    centre = np.where(real[..., None], centre, np.nan)
    return Ellipse(centre, axes, angle % np.pi), real


def circle_conic(T_cam_circle: Pose, radius_m, camera: Camera) -> np.ndarray:
    """Image conic of circles in their frames' xy plane: C = H^-T diag(1, 1, -r^2) H^-1."""
    R, p = T_cam_circle.rotation, T_cam_circle.position_m
    H = camera.K @ np.concatenate([R[..., :, :2], p[..., :, None]], -1)
    H_inv = np.linalg.inv(H)
    r2 = np.broadcast_to(np.asarray(radius_m, float) ** 2, p.shape[:-1])
    D = np.zeros((*r2.shape, 3, 3))
    D[..., 0, 0] = D[..., 1, 1] = 1
    D[..., 2, 2] = -r2
    C = np.swapaxes(H_inv, -1, -2) @ D @ H_inv
    return C / np.linalg.norm(C, axis=(-2, -1), keepdims=True)


def circle_ellipse(T_cam_circle: Pose, radius_m, camera: Camera) -> Ellipse:
    """Undistorted image of circles in space; NaN where it is no ellipse."""
    return ellipse_from_conic(circle_conic(T_cam_circle, radius_m, camera))[0]


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


def rotation_z(angle_rad) -> np.ndarray:
    """Rotations about z, (...) -> (..., 3, 3)."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    o, i = np.zeros_like(c), np.ones_like(c)
    return np.stack([np.stack([c, -s, o], -1), np.stack([s, c, o], -1), np.stack([o, o, i], -1)], -2)


def rotation_angle_rad(rotation) -> np.ndarray:
    """Angles of rotation matrices in [0, pi], (..., 3, 3) -> (...); accurate near zero too."""
    R = np.asarray(rotation)
    skew = (R - np.swapaxes(R, -1, -2))[..., [2, 0, 1], [1, 2, 0]]
    return np.arctan2(np.linalg.norm(skew, axis=-1), np.trace(R, axis1=-2, axis2=-1) - 1)


def rotation_vector(R) -> np.ndarray:
    """Rotation vectors (..., 3) of matrices (..., 3, 3): axis times angle; zero at exactly half a turn."""
    sine = (R - np.swapaxes(R, -1, -2))[..., [2, 0, 1], [1, 2, 0]] / 2
    length = np.linalg.norm(sine, axis=-1)
    angle = np.arctan2(length, (np.trace(R, axis1=-2, axis2=-1) - 1) / 2)
    return sine * (angle / np.maximum(length, 1e-12))[..., None]


def equal_turns(yaw_period_rad: float) -> np.ndarray:
    """Rotations about z that an object which repeats every ``yaw_period_rad`` does not show, (K, 3, 3)."""
    return rotation_z(np.arange(round(2 * np.pi / yaw_period_rad)) * yaw_period_rad)


def rotation_between_rad(R_a, R_b, yaw_period_rad: float) -> np.ndarray:
    """Smallest angle between orientations of an object that repeats every ``yaw_period_rad`` about its
    own z axis, (..., 3, 3) x 2 -> (...)."""
    relative = np.swapaxes(R_a, -1, -2) @ R_b
    return np.min(rotation_angle_rad(relative[..., None, :, :] @ equal_turns(yaw_period_rad)), -1)


def on_plane(points_px, T_cam_port: Pose, height_m: float, camera: Camera) -> np.ndarray:
    """Where lines of sight meet the port's plane z = height, (..., 2) px -> (..., 2) m; NaN if they don't."""
    T_port_cam = T_cam_port.inverse
    direction = bearings(points_px, camera) @ T_port_cam.rotation.T
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (height_m - T_port_cam.position_m[2]) / direction[..., 2]
    along = np.where((along > 0) & np.isfinite(along), along, np.nan)
    return T_port_cam.position_m[:2] + along[..., None] * direction[..., :2]


def ideal_masks(T_cam_port: Pose, port: Port, camera: Camera, samples: int = 4) -> np.ndarray:
    """Share of each pixel that ring and markers cover when nothing hides them, (2, H, W) f32.

    Each pixel is the mean of ``samples`` x ``samples`` lines of sight.
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
