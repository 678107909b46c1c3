"""Geometry against other people's code: pye3d, OpenCV, scikit-image."""

import json
from dataclasses import replace
from importlib.util import find_spec

import cv2
import numpy as np
import pye3d_answers
import pytest
from hypothesis import given, settings
from skimage.measure import EllipseModel
from strategies import CAMERA, ellipses, seeds

from lmmap.pipeline import circle, ellipse
from lmmap.types import Ellipse

NU = 0.08
ANSWERS = json.loads(pye3d_answers.FILE.read_text())


def circles_of_pye3d(made: str) -> list:
    """Its circles of the ellipses in ``pye3d.json``: those committed there, or what it answers now."""
    if made == "committed":
        return ANSWERS["circles"]
    return [pye3d_answers.circles(e, ANSWERS["focal_px"]) for e in ANSWERS["ellipses"]]


@pytest.mark.parametrize("made", ["committed"] + ["anew"] * (find_spec("pye3d") is not None))
def test_pye3d_finds_the_same_two_circles(made):
    camera = replace(CAMERA, fx_px=ANSWERS["focal_px"], fy_px=ANSWERS["focal_px"])
    for (u, v, *axes_px, angle_rad), theirs in zip(ANSWERS["ellipses"], circles_of_pye3d(made), strict=True):
        ours = circle.poses(Ellipse(camera.K[:2, 2] + [u, v], axes_px, angle_rad), camera, NU)
        for pose in ours:
            centre, normal = min(theirs, key=lambda c: np.linalg.norm(c[1] - pose.normal))
            np.testing.assert_allclose(normal, pose.normal, atol=2e-5)
            np.testing.assert_allclose(NU * np.array(centre), pose.position_m, atol=2e-6)


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
