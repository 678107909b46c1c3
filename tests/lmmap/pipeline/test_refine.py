"""A pose sharpened by what is known of it: faint rings say less, and an unknown yaw is not refined."""

from dataclasses import replace

import numpy as np
import pytest
from strategies import CAMERA, PORT

from lmmap.geometry.port import ideal_masks
from lmmap.geometry.rotations import rotation_z
from lmmap.pipeline import circle, yaw
from lmmap.pipeline.refine import on_masks, sigma_px
from lmmap.pipeline.ring import find_ring
from lmmap.pipeline.setup import Setup
from lmmap.settings import OURS
from lmmap.types import Pose

T0 = Pose(rotation_z(0.3) @ np.diag([1.0, -1, -1]), np.array([0.01, 0.02, 0.6]))
RING, MARKERS = (np.asarray(mask, np.float32) for mask in ideal_masks(T0, PORT, CAMERA))
SETUP = Setup(PORT, CAMERA, "rgb")
CLEAR = find_ring(RING, SETUP)


def test_a_faint_ring_is_known_worse():
    faint = find_ring(0.6 * RING, SETUP)
    assert faint.score == pytest.approx(0.6 * CLEAR.score, rel=0.02)
    half, least, less, clear = (
        sigma_px(replace(CLEAR, score=score), SETUP) for score in (0.5, OURS.min_ring_score, 0.0, 1.0)
    )
    assert half / clear == pytest.approx(2) and least == less < np.inf


def test_an_unknown_yaw_is_not_refined():
    circles = circle.poses(CLEAR.ellipse, CAMERA, PORT.ring_radius_m)
    best = yaw.fast_yaw(MARKERS, circles, PORT, CAMERA)
    unsure = replace(best, yaw_margin=OURS.min_yaw_margin - 0.01, sigma_rad=PORT.yaw_period_rad / 12**0.5)
    (refined, _, known, _), (kept, _, wide, _) = (
        on_masks(fit, CLEAR, MARKERS, SETUP) for fit in (best, unsure)
    )
    assert best.yaw_margin >= OURS.min_yaw_margin
    assert not np.array_equal(refined.position_m, best.T_cam_port.position_m)
    np.testing.assert_array_equal(kept.position_m, best.T_cam_port.position_m)
    turn = [np.sqrt(T0.normal @ C[3:6, 3:6] @ T0.normal) for C in (known, wide)]
    assert turn[1] == pytest.approx(unsure.sigma_rad, rel=0.05) and turn[0] < 0.2 * turn[1]
