"""Where a predicted ring can be seen: its box holds what the state does not know."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from strategies import CAMERA, PORT, pose

from lmmap.geometry.port import circle_points_m
from lmmap.geometry.projection import project
from lmmap.pipeline.masks import markers_box_px
from lmmap.pipeline.ring import strip_px
from lmmap.pipeline.setup import Setup
from lmmap.tracking.crop import expected_ring
from lmmap.tracking.motion_model import MotionState
from lmmap.types import Pose

SETUP = Setup(PORT, CAMERA, "rgb")
T0 = pose((180, 120), 0.6, 0.5, 0.8)
SPREAD = np.array([4e-3, 6e-3, 10e-3, 0.05, 0.03, 0.08])


def state(T=T0, scale=1.0):
    return MotionState.start(0, T, np.diag(scale * SPREAD) ** 2)


def test_the_box_holds_the_rings_of_nearly_all_poses_that_the_state_allows():
    rng, near = np.random.default_rng(0), expected_ring(state(), SETUP)
    outside = 0
    for _ in range(400):
        step = SPREAD * rng.standard_normal(6)
        T = Pose(Rotation.from_rotvec(step[3:]).as_matrix() @ T0.rotation, T0.position_m + step[:3])
        points_px = project(T @ circle_points_m(PORT.ring_outer_radius_m), CAMERA)
        outside += np.any(points_px < near.ring.low_px) or np.any(points_px > near.ring.high_px)
    assert outside <= 2


def test_what_is_known_exactly_needs_no_more_than_the_strip():
    near, less_known = expected_ring(state(scale=1e-6), SETUP), expected_ring(state(), SETUP)
    margin_px = strip_px(near.ellipse, SETUP) + 1
    ring_px = near.ellipse.points(720)
    np.testing.assert_allclose(ring_px.min(0) - near.ring.low_px, margin_px, atol=0.5)
    np.testing.assert_allclose(near.ring.high_px - ring_px.max(0), margin_px, atol=0.5)
    assert less_known.ring.holds(near.ring) and less_known.markers.holds(near.markers)
    assert not near.ring.holds(less_known.ring)


def test_the_markers_box_holds_those_of_nearly_all_poses_that_the_state_allows():
    rng, near, outside = np.random.default_rng(0), expected_ring(state(), SETUP), 0
    for _ in range(400):
        step = SPREAD * rng.standard_normal(6)
        T = Pose(Rotation.from_rotvec(step[3:]).as_matrix() @ T0.rotation, T0.position_m + step[:3])
        outside += not near.markers.holds(markers_box_px(T[None], PORT, CAMERA))
    assert outside <= 4


@pytest.mark.parametrize("position_m", [(0, 0, -0.5), (0, 0, 0.03), (3.0, 0, 0.5)])
def test_nothing_is_expected_behind_the_camera_or_beside_the_image(position_m):
    assert expected_ring(state(Pose(T0.rotation, position_m)), SETUP) is None
