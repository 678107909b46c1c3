"""The ring among clutter, by points of one neighbourhood."""

from dataclasses import replace

import cv2
import numpy as np
from hypothesis import given, settings
from strategies import CAMERA, ellipses

from lmmap.pipeline import ellipse, local_search
from lmmap.pipeline.ring import skeleton_points
from lmmap.settings import OURS
from lmmap.types import Ellipse

RING = Ellipse([110, 140], [40, 31], 0.6)


def drawn(e: Ellipse, clutter: int = 0, rng=None):
    """A mask of an ellipse's stroke, and of straight lines away from it."""
    mask = np.zeros(CAMERA.size_px[::-1], np.uint8)
    for _ in range(clutter):
        start, end = rng.uniform([175, 5], np.array(CAMERA.size_px) - 5, (2, 2))
        cv2.line(mask, *(tuple(int(c) for c in p) for p in (start, end)), 255, 2)
    stroke_px = max(2, round(0.19 * e.semi_axes_px[0]))
    cv2.polylines(mask, [np.round(e.points() * 16).astype(np.int32)], True, 255, stroke_px, shift=4)
    return cv2.GaussianBlur(mask / np.float32(255), (0, 0), 0.8)


def close(fit, e: Ellipse) -> bool:
    return (
        fit is not None
        and np.linalg.norm(fit.centre_px - e.centre_px) < 2
        and np.allclose(fit.semi_axes_px, e.semi_axes_px, rtol=0.04)
    )


def searched(mask, seed=0):
    """What the local and what the global search find."""
    points, rngs = skeleton_points(mask), (np.random.default_rng(seed) for _ in range(2))
    return (
        local_search.fit_local(points, mask, next(rngs), CAMERA)[0],
        ellipse.fit_ransac(points, next(rngs))[0],
    )


@settings(max_examples=20)
@given(ellipses(min_ratio=0.5))
def test_where_there_is_only_a_ring_both_searches_find_it(e):
    local, anywhere = searched(drawn(e))
    assert close(local, e) and close(anywhere, e)


def test_among_clutter_the_local_search_finds_what_the_global_one_misses():
    hits = np.array([[close(f, RING) for f in searched(drawn(RING, 15, np.random.default_rng(k)), k)]
                     for k in range(8)])  # fmt: skip
    local, anywhere = hits.mean(0)
    assert local == 1 and anywhere < 0.5


def test_parallel_lines_are_no_ring():
    for k in range(4):
        mask = np.zeros(CAMERA.size_px[::-1], np.float32)
        for row in range(20, 250, 25):
            cv2.line(mask, (20, row), (330, row + 10 * k), 1, 2)
        assert (
            local_search.fit_local(skeleton_points(mask), mask, np.random.default_rng(k), CAMERA)[0] is None
        )


def test_samples_lie_within_one_radius_of_their_seed():
    rng = np.random.default_rng(1)
    points = rng.uniform(0, 300, (500, 2))
    samples = local_search.neighbour_samples(points, rng, 400)
    away = np.linalg.norm(points[samples] - points[samples[:, :1]], axis=-1)
    assert samples.shape[1] == 5 and len(samples) > 100
    assert away.max() < local_search.RADIUS_PX[1]


def test_contrast_is_one_on_a_clean_ring_and_falls_with_a_filled_one():
    ring, filled = drawn(RING), drawn(RING)
    cv2.ellipse(filled, (110, 140), (40, 31), np.rad2deg(0.6), 0, 360, 1, -1)
    on_ring, on_disc = (
        local_search.contrast(Ellipse([RING.centre_px], [RING.semi_axes_px], [RING.angle_rad]), m, CAMERA)
        for m in (ring, filled)
    )
    assert on_ring > 0.9 and on_disc < 0.6


def test_no_points_and_one_point_are_no_ellipse():
    mask, rng = drawn(RING), np.random.default_rng(0)
    for points in (np.zeros((0, 2)), np.ones((9, 2))):
        fit, inliers = local_search.fit_local(points, mask, rng, CAMERA, replace(OURS, min_contrast=0.0))
        assert fit is None and inliers.shape == (len(points),) and not inliers.any()
