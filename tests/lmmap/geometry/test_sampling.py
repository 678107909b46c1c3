"""Values of images at points: bilinear, and zero wherever there is no image."""

import numpy as np
import pytest

from lmmap.geometry.sampling import sample

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
