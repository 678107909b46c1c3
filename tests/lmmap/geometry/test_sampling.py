"""Values of images at points: bilinear, and zero wherever there is no image."""

from dataclasses import replace

import numpy as np
import pytest

from lmmap.geometry.projection import distort_points
from lmmap.geometry.sampling import profiles, sample
from lmmap.types import Camera

IMAGE = np.arange(12, dtype=np.float32).reshape(3, 4) + 1


def test_pixels_and_the_middles_between_them():
    np.testing.assert_allclose(
        sample(IMAGE, np.array([[0.0, 0], [3, 2], [1.5, 0], [2, 0.5]])), [1, 12, 2.5, 5]
    )


@pytest.mark.parametrize("point", [(-2, 1), (1, 4), (np.nan, 1), (np.nan, np.nan), (1e6, 1), (-1e300, 1e300)])
def test_outside_the_image_and_behind_the_camera_values_are_zero(point):
    points = np.array([[point, (1, 1)]], float)
    before = points.copy()
    np.testing.assert_array_equal(sample(IMAGE, points), [[0, 6]])
    np.testing.assert_array_equal(points, before)


def test_profiles_of_a_slope_are_straight_and_a_lens_bends_them():
    slope = np.tile(np.arange(346, dtype=np.float32), (260, 1))
    points, directions = np.array([[100.0, 90], [200, 150]]), np.array([[1.0, 0], [0.5, 0.75]])
    offsets = np.array([-4.0, 0, 8])
    straight = points[:, :1] + directions[:, :1] * offsets
    np.testing.assert_allclose(profiles(slope, points, directions, offsets), straight, atol=1e-4)
    lens = replace(Camera.davis346(), distortion=(-0.3, 0.1))
    line = points[:, None] + offsets[:, None] * directions[:, None]
    bent = profiles(slope, points, directions, offsets, lens)
    np.testing.assert_allclose(bent, distort_points(line, lens)[..., 0], atol=1 / 32)
