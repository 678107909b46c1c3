"""Where a predicted port can be seen: the expected ellipse, and boxes that its uncertainty widens."""

from __future__ import annotations

import numpy as np

from ..geometry.conics import circle_ellipse, is_view
from ..geometry.port import circle_points_m
from ..geometry.projection import project_points
from ..geometry.rotations import single_rotation_matrix
from ..pipeline import circle
from ..pipeline.crops import Box
from ..pipeline.masks import Expected, markers_box_px
from ..pipeline.ring import strip_px
from ..pipeline.setup import Setup
from ..types import Camera, Port, Pose
from .motion_model import MotionState


def expected_ring(state: MotionState, setup: Setup) -> Expected | None:
    """The ring of a predicted state in the pixels of a camera; None if part of it is behind the camera, or
    its box is outside the image.

    The ring's box holds the strip in which the contour is traced, widened by ``crop_sigmas`` standard
    deviations of the ring's points: to first order, a pixel with the Jacobian J by the pose has the variance
    diag(J P J').  The markers' box covers both poses that the expected ellipse allows.
    """
    port, camera, settings = setup.port, setup.camera, setup.settings
    points_px, sigma_px = ring_spread_px(state, port, camera)
    ellipse = circle_ellipse(state.T_cam_port, port.ring_radius_m, camera)
    if not (np.isfinite(sigma_px).all() and is_view(ellipse, camera)):
        return None
    margin_px = settings.crop_sigmas * sigma_px + strip_px(ellipse, setup) + 1
    low_px, high_px = (points_px - margin_px).min(0), (points_px + margin_px).max(0)
    if np.any(high_px < 0) or np.any(low_px > np.array(camera.size_px) - 1):
        return None
    border_px = settings.marker_border_px + settings.crop_sigmas * sigma_px.max() + 1
    both = circle.poses(ellipse, camera, port.ring_radius_m)
    markers = markers_box_px(both, port, camera, border_px)
    return Expected(ellipse, Box(low_px, high_px), markers)


def ring_spread_px(state: MotionState, port: Port, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Points (36, 2) of a state's ring in pixels, and their standard deviations along u and v; not finite for
    a point behind the camera."""
    poses = _standard_deviations(state)
    points_px = project_points(poses, circle_points_m(port.ring_radius_m, 36), camera)  # (7, 36, 2)
    return points_px[0], np.sqrt(np.sum((points_px[1:] - points_px[0]) ** 2, 0))


def _standard_deviations(state: MotionState) -> Pose:
    """The state's pose, and that moved by each column of its covariance's root, (7,)."""
    steps = np.vstack([np.zeros(6), np.linalg.cholesky(state.pose_covariance).T])
    turn = np.stack([single_rotation_matrix(step[3:]) for step in steps])
    return Pose(turn @ state.T_cam_port.rotation, state.T_cam_port.position_m + steps[:, :3])
