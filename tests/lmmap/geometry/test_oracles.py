"""Geometry against other people's code: pye3d, OpenCV, scikit-image."""

import cv2
import numpy as np
from hypothesis import assume, given, settings
from pye3d.cpp.projections import unproject_ellipse
from pye3d.geometry.primitives import Ellipse as PupilEllipse
from skimage.measure import EllipseModel
from strategies import CAMERA, ellipses, seeds, visible_poses

from lmmap.geometry import conics
from lmmap.pipeline import circle, ellipse

NU = 0.08


@settings(max_examples=100)
@given(visible_poses(min_tilt_deg=5, max_tilt_deg=70))
def test_pye3d_finds_the_same_two_circles(T):
    # it drifts toward head-on, hence from 5 deg, and fails on axes along the image's and on ellipses about
    # the principal point, from which it wants them
    e = conics.circle_ellipse(T, NU, CAMERA)
    centre_px = e.centre_px - [CAMERA.cx_px, CAMERA.cy_px]
    assume(abs(np.sin(2 * e.angle_rad)) > 0.02 and np.abs(centre_px).min() > 1)
    theirs = unproject_ellipse(
        PupilEllipse(centre_px, e.semi_axes_px[1], e.semi_axes_px[0], float(e.angle_rad)), CAMERA.fx_px
    )
    ours = circle.poses(e, CAMERA, NU)
    for pose in ours:
        near = min(theirs, key=lambda c: np.linalg.norm(np.array(c.normal) - pose.normal))
        np.testing.assert_allclose(near.normal, pose.normal, atol=2e-5)
        np.testing.assert_allclose(NU * np.array(near.center), pose.position_m, atol=2e-6)


def points_of(e, seed, count=200, noise_px=0.0):
    rng = np.random.default_rng(seed)
    return e.points(3600)[rng.integers(0, 3600, count)] + noise_px * rng.standard_normal((count, 2))


@given(ellipses(max_ratio=0.97), seeds())
def test_opencv_fits_the_same_ellipse(e, seed):
    points = points_of(e, seed)
    (u, v), diameters, _ = cv2.fitEllipseDirect(points.astype(np.float32))
    fitted = ellipse.fit(points)
    np.testing.assert_allclose(fitted.centre_px, (u, v), atol=5e-3)
    np.testing.assert_allclose(np.sort(fitted.semi_axes_px), np.sort(diameters) / 2, atol=5e-3)


@settings(max_examples=15)
@given(ellipses(min_ratio=0.4, max_ratio=0.95), seeds())
def test_our_fit_is_as_near_to_noisy_points_as_scikit_images(e, seed):
    """Judged by scikit-image's own geometric residuals, and to second order in the noise."""
    points = points_of(e, seed, noise_px=0.3)
    theirs, fitted = EllipseModel.from_estimate(points), ellipse.fit(points)
    ours = EllipseModel(fitted.centre_px, fitted.semi_axes_px, float(fitted.angle_rad))
    rms = [np.sqrt(np.mean(model.residuals(points) ** 2)) for model in (ours, theirs)]
    assert rms[0] <= rms[1] * 1.001
