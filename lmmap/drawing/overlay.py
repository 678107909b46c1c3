"""Estimates drawn on their images: as single pictures or as a video."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from ..geometry.port import circle_points_m
from ..geometry.projection import bearings, project, rescale_px
from ..types import Camera, Estimate, Port, checked
from .video import Video

WIDTH_PX = 692  # of the pictures, at least: small sensors are enlarged by whole factors
COLOUR = {
    "mask": (86, 180, 233),
    "ellipse": (213, 94, 0),
    "predicted": (240, 228, 66),
    "text": (240, 240, 240),
}
AXES = ((255, 60, 60), (80, 220, 80), (60, 140, 255))  # x, y, z of the port: red, green, blue


@checked
def draw(
    image: np.ndarray,
    estimate: Estimate,
    camera: Camera | None = None,
    port: Port | None = None,
    ring_mask: np.ndarray | None = None,
) -> np.ndarray:
    """Draw an estimate on its image: the ellipse, the port's axes, and a line of text below; for a tracker's
    estimate also a ring where the port was predicted.

    Parameters
    ----------
    image
        The frame (H, W, 3) u8 RGB or the histogram (H, W) that was estimated.
    estimate
        The image's estimate.  The text gives its time, its status and, if it has a pose, the pose with its
        uncertainty.
    camera, port
        Those of the estimator.  Default: the bench's DAVIS 346 and the LM-MAP.
    ring_mask
        Mask (H, W) in [0, 1] to lay over the image, such as ``estimator.ring_mask(image)``.

    Returns
    -------
    numpy.ndarray
        The picture (H', W', 3) u8 RGB, enlarged by a whole factor where the sensor is small.

    Raises
    ------
    ValueError
        If the image's size is not the camera's, or an argument has another type.

    Examples
    --------
    >>> dark = np.zeros((260, 346, 3), np.uint8)
    >>> lmmap.draw(dark, lmmap.Estimate(8000, lmmap.Status.NO_RING)).shape[2]
    3
    """
    camera, port = camera or Camera.davis346(), port or Port.lm_map()
    image = np.asarray(image)
    if image.shape[:2] != camera.size_px[::-1]:
        raise ValueError(
            f"draw: expected an image of (H, W) = {camera.size_px[::-1]}, as the camera's, got {image.shape}"
        )
    scale = max(1, round(WIDTH_PX / camera.width_px))
    picture = background(image)
    if ring_mask is not None:
        tint = ring_mask[..., None] * np.array(COLOUR["mask"], np.float32)
        picture = picture * (1 - 0.5 * ring_mask[..., None]) + 0.5 * tint
    picture = picture.astype(np.uint8)
    picture = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)

    def line(points_px, colour, closed=False, width=2):
        if np.all(np.isfinite(points_px)) and np.abs(points_px).max(initial=0) < 1e4:
            fixed = np.round(rescale_px(points_px, scale) * 16).astype(np.int32)
            cv2.polylines(picture, [fixed], closed, colour, width, cv2.LINE_AA, shift=4)

    if estimate.predicted is not None:
        ring_m = circle_points_m(port.ring_radius_m, 180)
        line(project(estimate.predicted @ ring_m, camera), COLOUR["predicted"], closed=True)
    if estimate.ellipse is not None:
        rays = bearings(estimate.ellipse.points(180), replace(camera, distortion=()))
        line(project(rays, camera), COLOUR["ellipse"], closed=True)  # an ellipse is free of distortion
    if (T := estimate.T_cam_port) is not None:
        ends = np.concatenate([np.zeros((1, 3)), port.ring_radius_m * np.eye(3)])
        origin, *tips = project(T @ ends, camera)
        for tip, colour in zip(tips, AXES, strict=True):
            line(np.array([origin, tip]), colour, width=3)
    return np.vstack([picture, _caption(estimate, picture.shape[1])])


def background(image: np.ndarray) -> np.ndarray:
    """An image as RGB (H, W, 3) in [0, 255]: a frame as it is, a histogram in grey with its peaks clipped."""
    if image.ndim == 3:
        return image.astype(np.float32)
    gray = np.minimum(image / max(float(np.percentile(image, 99.5)), 1.0), 1.0) * 255
    return np.repeat(gray.astype(np.float32)[..., None], 3, -1)


def _caption(estimate: Estimate, width: int) -> np.ndarray:
    text = f"{estimate.t_us * 1e-6:.3f} s  {estimate.status}"
    if estimate.T_cam_port is not None:
        x, y, z = 1e3 * estimate.T_cam_port.position_m
        text += f"  x {x:.0f}  y {y:.0f}  z {z:.0f} mm  marker {estimate.marker_score:.2f}"
    if estimate.confidence:
        text += f"  confidence {estimate.confidence:.2f}"
    covariance = estimate.covariance
    if covariance is not None and np.all(np.isfinite(covariance)):
        text += f"  +- {1e3 * float(np.sqrt(np.trace(np.asarray(covariance)[:3, :3]))):.1f} mm"
    strip = np.zeros((28, width, 3), np.uint8)
    cv2.putText(strip, text, (8, 19), cv2.FONT_HERSHEY_SIMPLEX, 0.45, COLOUR["text"], 1, cv2.LINE_AA)
    return strip


class Overlay:
    """A video of `draw`'s pictures, one per image, at the rate of the first two; use it in a ``with``
    block."""

    def __init__(self, path: Path, port: Port, camera: Camera):
        self.port, self.camera, self.video = port, camera, Video(path)
        self._first: tuple[int, np.ndarray] | None = None
        self._rate_hz: float | None = None

    def add(self, image: np.ndarray | None, estimate: Estimate, ring_mask: np.ndarray | None = None) -> None:
        """Draw the next image of the video; an estimate between images, which has no image, is skipped."""
        if image is None:
            return
        picture = draw(image, estimate, self.camera, self.port, ring_mask)
        if self._first is None:
            self._first = estimate.t_us, picture
            return
        if self._rate_hz is None:
            rate_hz = 1e6 / max(estimate.t_us - self._first[0], 1)
            self._rate_hz = float(np.clip(round(rate_hz, 2), 1, 120))
            self.video.add(self._first[1], self._rate_hz)
        self.video.add(picture, self._rate_hz)

    def __enter__(self):
        self.video.__enter__()
        return self

    def __exit__(self, *error):
        if self._first is not None and self._rate_hz is None:  # no second picture told the rate
            self.video.add(self._first[1], 1.0)
        self.video.__exit__(*error)
