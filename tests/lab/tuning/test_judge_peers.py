"""Whether a pose puts the ring where a person marked it."""

from dataclasses import replace

import numpy as np
from judge_peers import on_ring

from lmmap.geometry.conics import circle_ellipse
from lmmap.types import Camera, Ellipse, Port, Pose
from lmmap_lab.bench.laboratory import sequence, sequence_motion

CAMERA = Camera.davis346()
POSE = sequence_motion(sequence("realistic-1"), np.array([3.0]))[0]


def test_a_ring_is_right_within_four_pixels_and_an_eighth_of_its_size():
    outer = circle_ellipse(POSE, Port.lm_map().ring_outer_radius_m, CAMERA)
    assert on_ring(POSE, outer, CAMERA)
    assert on_ring(POSE, replace(outer, centre_px=outer.centre_px + np.array([2, 3])), CAMERA)
    assert not on_ring(POSE, replace(outer, centre_px=outer.centre_px + np.array([3, 3])), CAMERA)
    assert not on_ring(POSE, Ellipse(outer.centre_px, 0.85 * outer.semi_axes_px, outer.angle_rad), CAMERA)
    farther = Pose(POSE.rotation, 1.2 * POSE.position_m)
    assert not on_ring(farther, outer, CAMERA)
