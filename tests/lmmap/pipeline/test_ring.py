"""From a mask to the ring's contour, from anywhere and from where it is expected."""

from dataclasses import replace

import numpy as np
import pytest
from strategies import CAMERA, PORT, pose

from lmmap.geometry.conics import circle_ellipse
from lmmap.geometry.port import ideal_masks
from lmmap.pipeline.ring import find_ring, follow, stroke
from lmmap.pipeline.setup import Setup
from lmmap.settings import OURS
from lmmap.types import Ellipse, Status

SETUP = Setup(PORT, CAMERA, "rgb")
T0 = pose((180, 120), 0.6, 0.5, 0.8)
RING, MASK = circle_ellipse(T0, PORT.ring_radius_m, CAMERA), ideal_masks(T0, PORT, CAMERA)[0]


def test_a_ring_that_the_network_half_believes_is_found_beside_a_blob_that_it_is_sure_of():
    mask = np.float32(0.6) * MASK
    mask[2:30, 2:30] = 1.0
    ring = find_ring(mask, SETUP)
    np.testing.assert_allclose(ring.ellipse.semi_axes_px, RING.semi_axes_px, atol=0.5)
    assert ring.arc_coverage > 0.9
    assert find_ring(0 * mask, SETUP) == Status.NO_RING
    assert find_ring(np.where(MASK, 0, mask), SETUP) in (Status.NO_RING, Status.NO_ELLIPSE)


@pytest.mark.parametrize("step_px", [(0.0, 0.0), (4.0, -3.0), (-5.0, 2.0)])
def test_from_nearby_the_same_contour_is_reached(step_px):
    start = Ellipse(RING.centre_px + step_px, 1.03 * RING.semi_axes_px, RING.angle_rad)
    contour = follow(start, MASK, SETUP)
    np.testing.assert_allclose(contour.ellipse.centre_px, RING.centre_px, atol=0.15)
    np.testing.assert_allclose(contour.ellipse.semi_axes_px, RING.semi_axes_px, atol=0.15)
    assert contour.arc_coverage > 0.9


def test_an_expectation_is_no_evidence():
    u = np.arange(CAMERA.width_px)
    third = np.where(u < RING.centre_px[0] - 0.3 * RING.semi_axes_px[0], MASK, 0)
    for mask in (0 * MASK, third, 0.2 * MASK):
        assert follow(RING, mask, SETUP) is None


def test_gates_on_size_and_shape_hold_as_for_any_ring():
    far, flat = pose((180, 120), 2.6, 0.2), pose((180, 120), 0.6, 1.35)
    for T in (far, flat):
        ring, mask = circle_ellipse(T, PORT.ring_radius_m, CAMERA), ideal_masks(T, PORT, CAMERA)[0]
        assert follow(ring, mask, SETUP) is None


@pytest.mark.parametrize("factor", [0.9, 1.2, 1.7, 2.2])
@pytest.mark.parametrize("near", [None, RING])
def test_a_stroke_much_wider_than_the_port_s_is_no_ring_wherever_it_is_looked_for(factor, near):
    """Of an expected ring too: what is refused in the whole image is refused where it is expected."""
    half_m = factor * (PORT.ring_outer_radius_m - PORT.ring_radius_m)
    wide = replace(
        PORT, ring_inner_radius_m=PORT.ring_radius_m - half_m, ring_outer_radius_m=PORT.ring_radius_m + half_m
    )
    mask, right = ideal_masks(T0, wide, CAMERA)[0], factor <= OURS.widest_stroke
    assert (find_ring(mask, SETUP, near=near) == Status.NO_ELLIPSE) != right
    assert find_ring(mask, replace(SETUP, port=wide), near).width == pytest.approx(
        factor * stroke(PORT), rel=0.1
    )
