"""Estimates drawn on their images, as a video to look through."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from ..geometry.projection import bearings, project, rescale_px
from ..types import Camera, Estimate, InputError, Port

WIDTH_PX = 692  # of the pictures, at least: small sensors are enlarged by whole factors
BGR = {"mask": (233, 180, 86), "ellipse": (0, 94, 213), "text": (240, 240, 240)}
AXES = ((60, 60, 255), (80, 220, 80), (255, 140, 60))  # x, y, z of the port: red, green, blue


def draw(
    image: np.ndarray, estimate: Estimate, ring_mask: np.ndarray, port: Port, camera: Camera
) -> np.ndarray:
    """A picture (H', W, 3) BGR: the frame or histogram with the ring's mask, the ellipse, the port's axes,
    and below it the time, the status, the pose and, where the estimate has one, its uncertainty."""
    scale = max(1, round(WIDTH_PX / camera.width_px))
    picture = _background(image)
    tint = ring_mask[..., None] * np.array(BGR["mask"], np.float32)
    picture = (picture * (1 - 0.5 * ring_mask[..., None]) + 0.5 * tint).astype(np.uint8)
    picture = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)

    def line(points_px, colour, closed=False, width=2):
        if np.all(np.isfinite(points_px)) and np.abs(points_px).max(initial=0) < 1e4:
            fixed = np.round(rescale_px(points_px, scale) * 16).astype(np.int32)
            cv2.polylines(picture, [fixed], closed, colour, width, cv2.LINE_AA, shift=4)

    if estimate.ellipse is not None:
        rays = bearings(estimate.ellipse.points(180), replace(camera, distortion=()))
        line(project(rays, camera), BGR["ellipse"], closed=True)  # an ellipse is free of distortion
    if (T := estimate.T_cam_port) is not None:
        ends = np.concatenate([np.zeros((1, 3)), port.ring_radius_m * np.eye(3)])
        origin, *tips = project(T @ ends, camera)
        for tip, colour in zip(tips, AXES, strict=True):
            line(np.array([origin, tip]), colour, width=3)
    return np.vstack([picture, _caption(estimate, picture.shape[1])])


def _background(image: np.ndarray) -> np.ndarray:
    if image.ndim == 3:
        return image[..., ::-1].astype(np.float32)
    gray = np.minimum(image / max(float(np.percentile(image, 99.5)), 1.0), 1.0) * 255
    return np.repeat(gray.astype(np.float32)[..., None], 3, -1)


def _caption(estimate: Estimate, width: int) -> np.ndarray:
    text = f"{estimate.t_us * 1e-6:.3f} s  {estimate.status}"
    if estimate.T_cam_port is not None:
        x, y, z = 1e3 * estimate.T_cam_port.position_m
        text += f"  x {x:.0f}  y {y:.0f}  z {z:.0f} mm  marker {estimate.marker_score:.2f}"
    covariance = getattr(estimate, "covariance", None)
    if covariance is not None and np.all(np.isfinite(covariance)):
        text += f"  +- {1e3 * float(np.sqrt(np.trace(np.asarray(covariance)[:3, :3]))):.1f} mm"
    strip = np.zeros((28, width, 3), np.uint8)
    cv2.putText(strip, text, (8, 19), cv2.FONT_HERSHEY_SIMPLEX, 0.45, BGR["text"], 1, cv2.LINE_AA)
    return strip


class Overlay:
    """An MP4 of `draw`, one picture an image, played at the rate of the first two; use it in ``with``."""

    def __init__(self, path: Path, port: Port, camera: Camera):
        self.path, self.port, self.camera = path, port, camera
        self._writer, self._first = None, None
        if path.suffix.lower() not in (".mp4", ".avi"):
            raise InputError(f"{path}: cannot write '{path.suffix}'; name the video .mp4 or .avi")
        if not path.parent.is_dir():
            raise InputError(f"{path}: no folder {path.parent}; make it first")

    def add(self, image: np.ndarray, estimate: Estimate, ring_mask: np.ndarray) -> None:
        picture = draw(image, estimate, ring_mask, self.port, self.camera)
        if self._first is None:
            self._first = estimate.t_us, picture
            return
        if self._writer is None:
            self._open(1e6 / max(estimate.t_us - self._first[0], 1), picture)
            self._writer.write(self._first[1])
        self._writer.write(picture)

    def _open(self, rate_hz: float, picture: np.ndarray) -> None:
        fourcc = cv2.VideoWriter_fourcc(*("mp4v" if self.path.suffix.lower() == ".mp4" else "MJPG"))
        rate_hz = float(np.clip(round(rate_hz, 2), 1, 120))
        self._writer = cv2.VideoWriter(str(self.path), cv2.CAP_FFMPEG, fourcc, rate_hz, picture.shape[1::-1])
        if not self._writer.isOpened():
            raise InputError(f"{self.path}: cannot write a video there; choose a folder with room")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self._writer is None and self._first is not None:
            self._open(1.0, self._first[1])
            self._writer.write(self._first[1])
        if self._writer is not None:
            self._writer.release()
