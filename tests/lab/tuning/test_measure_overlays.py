"""Drawn poses beside a seen ring: each reading's own pose lies on its own place."""

import measure_overlays
import numpy as np
import pytest
from strategies import CAMERA, PORT, pose

from lmmap.geometry.conics import circle_ellipse
from lmmap.pipeline import circle

SEEN = pose((170, 50), 0.6, 0.7, 0.3)


def test_the_exact_pose_lies_on_the_ring_s_centre_and_the_printed_one_near_the_ellipse_s():
    same = measure_overlays.beside(SEEN, SEEN, CAMERA, PORT, 1.0)
    assert same["exact"] == pytest.approx(0, abs=1e-6) and same["along_px"] == pytest.approx(0, abs=1e-9)
    both = circle.paper_poses(circle_ellipse(SEEN, PORT.ring_radius_m, CAMERA), CAMERA, PORT.ring_radius_m)
    printed = both[int(np.argmax(both.normal @ SEEN.normal))]
    values = measure_overlays.beside(printed, SEEN, CAMERA, PORT, 1.0)
    assert values["printed"] == pytest.approx(0, abs=1e-6) and values["offset_px"] > 1
    assert values["along_px"] == pytest.approx(values["printed_along_px"])
    assert 0.7 < values["along_px"] / values["offset_px"] < 1.05
    assert values["printed less exact"] == pytest.approx(-values["exact"], abs=1e-6) and values["exact"] > 3


def test_only_the_printed_roots_and_the_true_centre_keep_a_ring_from_facing_the_camera():
    head_on = pose((CAMERA.cx_px, CAMERA.cy_px), 0.6, 0.0, 0.0)
    least = measure_overlays.least_tilts_deg(head_on, CAMERA, PORT)
    half_deg = np.rad2deg(np.arcsin(PORT.ring_radius_m / 0.6))
    assert least["four"] < 0.1 and least["printed"] > 1.9 * half_deg
    assert least["true centre"] > 0.99 * half_deg
