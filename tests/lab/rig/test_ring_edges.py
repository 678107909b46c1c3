"""The ring beneath drawn lines: its shift from a drawn pose, found on a made picture with glare."""

import cv2
import numpy as np
import pytest
from strategies import CAMERA, PORT, pose

from lmmap.geometry.conics import circle_ellipse
from lmmap.geometry.port import circle_points_m, ideal_masks
from lmmap.geometry.projection import project
from lmmap.types import Pose
from lmmap_lab.rig import ring_edges

TRUE = pose((170, 125), 0.45, 0.6, 0.3)
DRAWN = Pose(TRUE.rotation, np.add(TRUE.position_m, [0.0022, -0.0031, 0.004]))  # two pixels aside


def made(gain: float):
    """A bright ring on film with glare in it and lines of another pose: brightness, lines and glare."""
    ring = ideal_masks(TRUE, PORT, CAMERA)[0]
    noise = np.random.default_rng(0).normal(0, 4, ring.shape)
    grey = np.clip(60 + gain * cv2.GaussianBlur(ring, (0, 0), 1.0) + noise, 0, 255)
    lines = np.zeros(ring.shape, np.uint8)
    for radius_m in (PORT.ring_outer_radius_m, PORT.ring_inner_radius_m):
        points = np.round(16 * project(DRAWN @ circle_points_m(radius_m, 200), CAMERA)).astype(np.int32)
        cv2.polylines(lines, [points], True, 1, 1, cv2.LINE_8, 4)
    grey[lines > 0] = 150
    glare = np.zeros(ring.shape, bool)
    u, v = np.round(circle_ellipse(TRUE, PORT.ring_inner_radius_m, CAMERA).centre_px).astype(int)
    glare[v + 12 : v + 50, u - 25 : u + 25] = True
    grey[glare] = 255
    return grey, (lines > 0), glare


@pytest.mark.parametrize("level", [0.35, 0.65])
@pytest.mark.parametrize("gain", [200, 4000])
def test_the_shift_from_the_drawn_pose_is_found_to_a_fifth_of_a_pixel(level, gain):
    grey, lines, glare = made(gain)
    seen, found, _, left_px = ring_edges.measured(grey, lines | glare, DRAWN, PORT, CAMERA, level)
    assert (seen.side == ring_edges.OUTER).sum() > 50 and (seen.side == ring_edges.INNER).sum() > 25
    drawn, true, measured = (project(T.position_m, CAMERA) for T in (DRAWN, TRUE, found))
    assert np.linalg.norm(drawn - true) > 2
    np.testing.assert_allclose(measured, true, atol=0.2)
    assert np.rad2deg(np.arccos(found.normal @ TRUE.normal)) < 0.6 and np.median(np.abs(left_px)) < 0.2


def test_a_saturated_stroke_spreads_as_its_blur_says():
    """Half of the contrast is at 2.4 % of a stroke's height: 1.97 standard deviations of a pixel outside."""
    spreads = []
    for gain in (200, 4000):
        grey, lines, glare = made(gain)
        spreads.append(ring_edges.measured(grey, lines | glare, DRAWN, PORT, CAMERA)[2])
    assert spreads[0] == pytest.approx(0.0, abs=0.2) and spreads[1] == pytest.approx(1.97, abs=0.2)


def test_where_nothing_is_seen_there_are_no_edges():
    seen, found, *_ = ring_edges.measured(
        np.full((260, 346), 90.0), np.zeros((260, 346), bool), DRAWN, PORT, CAMERA
    )
    assert seen.points_px.shape == (0, 2) and found is DRAWN
