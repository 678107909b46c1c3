"""Images of any lens in the pixels that the networks know: resampled to the focal length of their training.

A network knows how wide the ring's stroke is in pixels at a distance.  Every step of the pipeline runs on the
resampled image and its camera: thresholds in pixels keep their meaning, and a large sensor takes no more time
than a small one.  The lens's distortion stays in the image: contours are measured as the lens made them,
and undistorted point by point.  A pose is the same in both cameras.
"""

from __future__ import annotations

import cv2
import numpy as np

from ..geometry.conics import conic_from_ellipse, ellipse_from_conic
from ..settings import OURS, Settings
from ..types import Camera, Ellipse


def network_camera(camera: Camera, settings: Settings = OURS) -> Camera:
    """The camera whose pixels the networks see: the same one where its focal length is near enough."""
    ratio = settings.trained_focal_px / np.array([camera.fx_px, camera.fy_px])
    near = np.abs(np.log(ratio)) <= np.log(settings.focal_slack)
    return camera if near.all() else camera.at_focal(settings.trained_focal_px)


def resample(image: np.ndarray, camera: Camera) -> np.ndarray:
    """An image (H, W, 3) u8 or a histogram (H, W) in a camera's pixels.

    A histogram keeps its counts a pixel, not their sum: an edge that passes releases as many events in a
    small pixel as in a large one.
    """
    if image.shape[:2] == camera.size_px[::-1]:
        return image
    smaller = camera.width_px * camera.height_px < image.shape[0] * image.shape[1]
    image = image if image.ndim == 3 else image.astype(np.float32)
    return cv2.resize(image, camera.size_px, interpolation=cv2.INTER_AREA if smaller else cv2.INTER_LINEAR)


def ellipse_in(ellipse: Ellipse, camera: Camera, target: Camera) -> Ellipse:
    """An undistorted ellipse of one camera's pixels in those of another that sees the same view."""
    if camera == target:
        return ellipse
    A = camera.K @ np.linalg.inv(target.K)
    return ellipse_from_conic(A.T @ conic_from_ellipse(ellipse) @ A)[0]
