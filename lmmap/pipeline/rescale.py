"""Images of any lens, resampled to the focal length on which the networks were trained.

A network knows how wide the ring's stroke is in pixels at a distance.  Every step of the pipeline runs on the
resampled image and its camera: thresholds in pixels keep their meaning, and a large sensor takes no more time
than a small one.  The lens's distortion stays in the image: contours are measured as the lens made them,
and undistorted point by point.  A pose is the same in both cameras.
"""

from __future__ import annotations

import warnings

import cv2
import numpy as np

from ..geometry.conics import conic_from_ellipse, ellipse_from_conic
from ..settings import OURS, Settings
from ..types import Camera, Ellipse, Port


def network_camera(camera: Camera, modality: str, settings: Settings = OURS) -> Camera:
    """The camera whose pixels the networks see: with the trained focal length, or as near to it as images may
    be enlarged.  A camera that is near enough is taken as it is."""
    focal_px = np.array([camera.fx_px, camera.fy_px])
    target_px = min(settings.trained_focal_px, settings.enlargement[modality] * focal_px.min())
    near = np.abs(np.log(target_px / focal_px)) <= np.log(settings.focal_slack)
    return camera if near.all() else camera.at_focal(target_px)


def enlarged_cameras(camera: Camera, modality: str, settings: Settings = OURS) -> list[Camera]:
    """Cameras for further looks at a histogram whose lens is too short for the networks, up to the trained
    focal length.  Frames are enlarged at the first look."""
    limit_px = settings.focal_slack * settings.trained_focal_px
    short = modality == "event" and is_short(camera, settings)
    factors = [f for f in settings.enlarged_looks if f * camera.fx_px <= limit_px] if short else []
    return [camera.at_focal(f * camera.fx_px) for f in factors]


def trained_range_m(camera: Camera, port: Port, settings: Settings = OURS) -> tuple[float, float]:
    """Nearest and farthest distance (m) at which the port's ring has a size that the networks were trained
    on, in images that are not enlarged."""
    focal_px = min(camera.fx_px, settings.trained_focal_px)
    small_px, large_px = settings.trained_ring_px
    return focal_px * port.ring_radius_m / large_px, focal_px * port.ring_radius_m / small_px


def is_short(camera: Camera, settings: Settings = OURS) -> bool:
    """Whether the lens's focal length is too short in pixels for the networks."""
    return camera.fx_px * settings.focal_slack < settings.trained_focal_px


def warn_of_lens(camera: Camera, port: Port, settings: Settings = OURS) -> None:
    """Warn once if the lens `is_short`."""
    if is_short(camera, settings):
        near_m, far_m = trained_range_m(camera, port, settings)
        warnings.warn(
            f"lens of {camera.fx_px:.0f} px: shorter than in training; with it, the networks know the ring "
            f"from {near_m:.2f} to {far_m:.2f} m, and farther away most images have no pose",
            stacklevel=4,
        )


def outside_training(ring: Ellipse, settings: Settings = OURS) -> bool:
    """Whether a ring, in the networks' pixels, is smaller or larger than any that they were trained on."""
    small_px, large_px = settings.trained_ring_px
    return not small_px <= ring.semi_axes_px[0] <= large_px


def resample(image: np.ndarray, camera: Camera) -> np.ndarray:
    """Resample an image (H, W, 3) u8 or a histogram (H, W) to a camera's pixels.

    A histogram keeps its counts per pixel, not their sum: a passing edge triggers as many events in a small
    pixel as in a large one.
    """
    if image.shape[:2] == camera.size_px[::-1]:
        return image
    smaller = camera.width_px * camera.height_px < image.shape[0] * image.shape[1]
    image = image if image.ndim == 3 else image.astype(np.float32)
    return cv2.resize(image, camera.size_px, interpolation=cv2.INTER_AREA if smaller else cv2.INTER_CUBIC)


def ellipse_in(ellipse: Ellipse, camera: Camera, target: Camera) -> Ellipse:
    """Convert an undistorted ellipse from one camera's pixels to those of another with the same view."""
    if camera == target:
        return ellipse
    A = camera.K @ np.linalg.inv(target.K)
    return ellipse_from_conic(A.T @ conic_from_ellipse(ellipse) @ A)[0]
