"""Sub-pixel contours on masks drawn from the geometry."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from strategies import CAMERA, PORT, WIDE, pose

from lmmap.geometry import conics, projection
from lmmap.geometry.conic_fit import sampson_distance
from lmmap.geometry.port import ideal_masks
from lmmap.pipeline import circle, ellipse
from lmmap.pipeline.ring import skeleton_points, stroke
from lmmap.refinement import contour
from lmmap.types import Ellipse


def mask_of(T, rng, camera=CAMERA, blur_px=0.8, noise=0.03):
    mask = cv2.GaussianBlur(ideal_masks(T, PORT, camera)[0], (0, 0), blur_px)
    return (mask + noise * rng.standard_normal(mask.shape)).clip(0, 1).astype(np.float32)


def pose_error(e, T):
    solved = circle.poses(e, CAMERA, PORT.ring_radius_m)
    cosine = solved.normal @ T.normal
    position = np.linalg.norm(solved.position_m - T.position_m, axis=-1)
    return np.rad2deg(np.arccos(cosine.max().clip(-1, 1))), 1e3 * position[cosine.argmax()]


TILTED = [
    pose((170, 120), z, np.deg2rad(t), a)
    for z, t, a in [(0.35, 20, 1), (0.5, 40, 3), (0.7, 55, 5), (0.9, 30, 0)]
]


def test_refinement_on_the_mask_is_sub_pixel_and_better_than_the_skeleton():
    rng = np.random.default_rng(0)
    errors = []
    for T in TILTED:
        mask = mask_of(T, rng)
        coarse, _ = ellipse.fit_ransac(skeleton_points(mask), rng)
        fine = contour.trace(coarse, mask, 0.25 * coarse.semi_axes_px[0]).ellipse
        errors.append((pose_error(fine, T), pose_error(coarse, T)))
    fine, coarse = np.moveaxis(errors, 1, 0)
    assert np.all(fine < [0.12, 2.0])  # deg, mm
    assert np.all(np.mean(fine**2, 0) < np.mean(coarse**2, 0) / 4)


@pytest.mark.parametrize("T", TILTED[:3])
def test_refinement_bears_a_missing_arc_and_a_second_blob(T):
    rng = np.random.default_rng(0)
    mask = mask_of(T, rng)
    around = conics.circle_ellipse(T, PORT.ring_radius_m, CAMERA).points(8)
    u, v = np.round(around[0]).astype(int)
    mask[v - 12 : v + 12, u - 12 : u + 12] = 0
    u, v = np.round(around[4] * 0.8 + T_centre(T) * 0.2).astype(int)
    mask[v - 5 : v + 5, u - 5 : u + 5] = 1
    coarse, _ = ellipse.fit_ransac(skeleton_points(mask), rng)
    fine = contour.trace(coarse, mask, 0.25 * coarse.semi_axes_px[0]).ellipse
    assert pose_error(fine, T)[0] < 0.4


def T_centre(T):
    return projection.project(T.position_m, CAMERA)


@pytest.mark.parametrize("T", TILTED)
def test_what_is_fainter_than_half_the_ring_moves_no_edge(T):
    """A soft mass along the whole inner edge, as of a bright rim there."""
    bare = mask_of(T, np.random.default_rng(0), noise=0.0)
    disc = replace(PORT, ring_inner_radius_m=0.8 * PORT.ring_inner_radius_m)
    soft = np.maximum(bare, 0.3 * cv2.GaussianBlur(ideal_masks(T, disc, CAMERA)[0], (0, 0), 0.8))
    start = conics.circle_ellipse(T, PORT.ring_radius_m, CAMERA)
    before, after = (contour.trace(start, mask, 0.4 * start.semi_axes_px[0]) for mask in (bare, soft))
    assert pose_error(after.ellipse, T)[1] < pose_error(before.ellipse, T)[1] + 0.6
    moved_px = [own.mean() - usual.mean() for own, usual in zip(gaps(after, T), gaps(before, T), strict=True)]
    assert abs(moved_px[0]) < 0.06 and abs(moved_px[1]) < 0.01


def gaps(ring, T):
    """Distances of both edges' points from the circles that they are of."""
    for edge, radius_m in zip(ring.edges, (PORT.ring_inner_radius_m, PORT.ring_outer_radius_m), strict=True):
        theta = conics.conic_coefficients(conics.circle_conic(T, radius_m, CAMERA))
        yield sampson_distance(theta, edge.points_px)


@pytest.mark.parametrize("T", TILTED)
def test_edges_lie_on_circles_of_their_own_radii(T):
    start = conics.circle_ellipse(T, PORT.ring_radius_m, CAMERA)
    ring = contour.trace(start, mask_of(T, np.random.default_rng(0)), 0.3 * start.semi_axes_px[0])
    for gap_px, edge in zip(gaps(ring, T), ring.edges, strict=True):
        assert abs(gap_px.mean()) < 0.15 and gap_px.std() == pytest.approx(np.median(edge.sigma_px), rel=0.7)
    assert ring.width == pytest.approx(stroke(PORT), rel=0.06)


def test_a_soft_edge_counts_less():
    """Over half of the ring it is blurred by as much as the ring is wide."""
    T = TILTED[1]
    sharp = mask_of(T, np.random.default_rng(0), noise=0.02)
    soft = cv2.GaussianBlur(sharp, (0, 0), 3.0)
    start = conics.circle_ellipse(T, PORT.ring_radius_m, CAMERA)
    left = np.arange(CAMERA.width_px) < start.centre_px[0]
    for edge in contour.trace(start, np.where(left, soft, sharp), 0.4 * start.semi_axes_px[0]).edges:
        on_left = edge.points_px[:, 0] < start.centre_px[0] - 5
        assert np.median(edge.sigma_px[on_left]) > 1.5 * np.median(edge.sigma_px[~on_left])


def test_without_a_stroke_there_is_no_contour():
    e = Ellipse([150, 120], [60, 35], 0.5)
    for mask in (np.zeros((260, 346)), np.ones((260, 346))):
        assert contour.trace(e, mask, 10.0) is None


def test_refinement_recovers_where_something_sticks_to_the_stroke():
    # a patch along 50 deg of the inner edge leads the skeleton, and the first ellipse, astray
    rng, errors = np.random.default_rng(0), []
    for T in TILTED[:3]:
        truth = conics.circle_ellipse(T, PORT.ring_radius_m, CAMERA)
        around = truth.points(360)
        for start in range(0, 360, 60):
            mask = mask_of(T, rng)
            stuck = truth.centre_px + 0.82 * (around[start : start + 50] - truth.centre_px)
            for u, v in np.round(stuck).astype(int):
                mask[v - 2 : v + 3, u - 2 : u + 3] = 1
            coarse, _ = ellipse.fit_ransac(skeleton_points(mask), rng)
            fine = contour.trace(coarse, mask, 0.25 * coarse.semi_axes_px[0]).ellipse
            errors.append(pose_error(fine, T)[0])
    assert np.mean(np.array(errors) < 0.2) >= 0.85


@pytest.mark.parametrize("T", TILTED)
def test_a_lens_that_distorts_changes_nothing(T):
    rng = np.random.default_rng(0)
    start = conics.circle_ellipse(T, PORT.ring_radius_m, WIDE)
    start = Ellipse(start.centre_px + np.array([0.8, -0.6]), 1.01 * start.semi_axes_px, start.angle_rad)
    traced = contour.trace(start, mask_of(T, rng, WIDE), 0.25 * start.semi_axes_px[0], WIDE)
    solved = circle.poses(traced.ellipse, WIDE, PORT.ring_radius_m)
    cosine = solved.normal @ T.normal
    assert np.rad2deg(np.arccos(cosine.max().clip(-1, 1))) < 0.15
    assert 1e3 * np.linalg.norm(solved.position_m[cosine.argmax()] - T.position_m) < 2.0


def test_an_ellipse_traced_on_the_distorted_image_is_wrong():
    """The control: the same mask, its distortion forgotten."""
    T, rng = TILTED[0], np.random.default_rng(0)
    mask = mask_of(T, rng, WIDE)
    coarse, _ = ellipse.fit_ransac(skeleton_points(mask), rng)
    solved = circle.poses(contour.trace(coarse, mask, 12.0).ellipse, WIDE, PORT.ring_radius_m)
    assert 1e3 * np.linalg.norm(solved.position_m - T.position_m, axis=-1).min() > 4.0


def test_sigma_is_the_scatter_of_the_points():
    rng, e = np.random.default_rng(0), Ellipse([150, 120], [60, 35], 0.5)
    points = e.points(400) + 0.3 * rng.standard_normal((400, 2))
    assert contour.from_points(e, points).sigma_px == pytest.approx(0.3, rel=0.1)
    traced = contour.trace(*_mask_with_scatter())
    distances = np.linalg.norm(traced.points_px[:, None] - traced.ellipse.points(4000), axis=-1).min(1)
    assert traced.sigma_px == pytest.approx(np.sqrt(np.mean(distances**2)), rel=0.1)


def _mask_with_scatter():
    T = TILTED[0]
    start = conics.circle_ellipse(T, PORT.ring_radius_m, CAMERA)
    return start, mask_of(T, np.random.default_rng(0), noise=0.1), 0.25 * start.semi_axes_px[0]
