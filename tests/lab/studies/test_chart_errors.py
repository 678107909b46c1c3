"""Errors in the chart of cones are those of the circle, whichever of its two poses is meant."""

import numpy as np
from hypothesis import given
from strategies import CAMERA, PORT, pose, visible_poses

from lmmap.geometry import conics
from lmmap.pipeline import circle
from lmmap_lab.studies.chart_errors import chart_error

NU = PORT.ring_radius_m


@given(visible_poses(), visible_poses())
def test_the_charts_error_is_zero_for_the_same_circle_only(a, b):
    np.testing.assert_allclose(chart_error(a, a, NU, CAMERA), 0, atol=1e-7)
    if np.linalg.norm(a.position_m - b.position_m) > 0.05:
        assert np.linalg.norm(chart_error(a, b, NU, CAMERA)) > 1e-3


def test_the_other_branch_has_the_same_chart():
    T = pose((200, 110), 0.6, 0.5, 0.7)
    pair = circle.poses(conics.circle_ellipse(T, NU, CAMERA), CAMERA, NU)
    np.testing.assert_allclose(chart_error(pair[0], pair[1], NU, CAMERA), 0, atol=1e-7)
