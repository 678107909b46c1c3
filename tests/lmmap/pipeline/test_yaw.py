from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import CAMERA, PORT, WIDE, pose, visible_poses

from lmmap.geometry import conics, projection, rotations
from lmmap.geometry.port import ideal_masks
from lmmap.pipeline import circle, yaw
from lmmap.settings import OURS
from lmmap.types import Pose

both = pytest.mark.parametrize("find", [yaw.fast_yaw, yaw.paper_yaw], ids=["fast", "paper"])


def candidates(T, camera=CAMERA):
    e = conics.circle_ellipse(T, PORT.ring_radius_m, camera)
    return circle.poses(e, camera, PORT.ring_radius_m)


def mask_of(T, camera=CAMERA, noise=0.05, seed=0):
    rng = np.random.default_rng(seed)
    mask = cv2.GaussianBlur(ideal_masks(T, PORT, camera, 3)[1], (0, 0), 0.7)
    return (mask + noise * rng.standard_normal(mask.shape)).clip(0, 1).astype(np.float32)


def error_deg(T, truth):
    return np.rad2deg(rotations.rotation_between_rad(T.rotation, truth.rotation, PORT.yaw_period_rad))


def spread(count, min_tilt_deg, max_tilt_deg, max_distance_m=0.8):
    """Poses spread over tilt, azimuth and yaw."""
    rng = np.random.default_rng(7)
    for _ in range(count):
        tilt = np.deg2rad(rng.uniform(min_tilt_deg, max_tilt_deg))
        centre, distance = rng.uniform([110, 90], [236, 170]), rng.uniform(0.4, max_distance_m)
        yield pose(centre, distance, tilt, *rng.uniform(0, 2 * np.pi, 2))


def test_the_fast_search_picks_the_normal_and_a_fraction_of_a_degree():
    fits = [(yaw.fast_yaw(mask_of(T), candidates(T), PORT, CAMERA), T) for T in spread(25, 8, 55)]
    errors = [error_deg(f.T_cam_port, T) for f, T in fits]
    assert np.percentile(errors, 95) < 0.25
    assert all(f.score > 0.7 for f, _ in fits)
    assert all(f.score > f.rival_score for f, _ in fits)


def test_the_papers_grid_is_as_good_as_its_step():
    errors = [
        error_deg(yaw.paper_yaw(mask_of(T), candidates(T), PORT, CAMERA).T_cam_port, T)
        for T in spread(15, 10, 50)
    ]
    assert np.median(errors) < 1.0
    assert np.max(errors) < 3.5


@both
@settings(max_examples=15)
@given(T=visible_poses(min_tilt_deg=10, max_tilt_deg=50, max_distance_m=0.8), turn=st.integers(0, 5))
def test_a_third_of_a_turn_changes_nothing(find, T, turn):
    turned = Pose(T.rotation @ rotations.rotation_z(turn * PORT.yaw_period_rad), T.position_m)
    mask, pair = mask_of(T, noise=0), candidates(T)
    first, second = find(mask, pair, PORT, CAMERA), find(mask_of(turned, noise=0), pair, PORT, CAMERA)
    assert error_deg(first.T_cam_port, second.T_cam_port) < 1e-6
    assert first.score == pytest.approx(second.score, abs=1e-4)


@settings(max_examples=15)
@given(visible_poses(min_tilt_deg=10, max_tilt_deg=50, max_distance_m=0.8), st.floats(0, 2 * np.pi))
def test_the_candidates_own_yaw_does_not_matter(T, start):
    mask, pair = mask_of(T), candidates(T)
    turned = Pose(pair.rotation @ rotations.rotation_z(start), pair.position_m)
    first, second = (yaw.fast_yaw(mask, c, PORT, CAMERA) for c in (pair, turned))
    assert error_deg(first.T_cam_port, second.T_cam_port) < 0.25


@both
def test_position_and_normal_are_those_of_the_candidates(find):
    T = pose((170, 120), 0.6, 0.5, 1.0, 2.0)
    pair = candidates(T)
    fit = find(mask_of(T), pair, PORT, CAMERA)
    best = int(np.argmax(pair.normal @ T.normal))
    for solution, k in ((fit.T_cam_port, best), (fit.rival, 1 - best)):
        np.testing.assert_allclose(solution.position_m, pair.position_m[k])
        np.testing.assert_allclose(solution.normal, pair.normal[k], atol=1e-12)


@both
def test_a_perfect_mask_scores_nearly_one(find):
    T = pose((170, 120), 0.4, 0.5, 1.0, 2.0)
    fit = find(ideal_masks(T, PORT, CAMERA)[1], candidates(T), PORT, CAMERA)
    assert 0.9 < fit.score <= 1
    assert fit.rival_score < 0.6


@both
def test_lens_distortion_is_taken_into_account(find):
    T = pose((230, 160), 0.45, 0.5, 1.0, 2.0)
    fit = find(mask_of(T, WIDE), candidates(T, WIDE), PORT, WIDE)
    assert error_deg(fit.T_cam_port, T) < 1.5
    assert fit.score > 0.6


@both
def test_an_empty_mask_scores_nothing(find):
    fit = find(np.zeros((260, 346), np.float32), candidates(pose((170, 120), 0.6, 0.5)), PORT, CAMERA)
    assert fit.score == fit.rival_score == 0


@both
def test_markers_outside_the_image_and_behind_the_camera_score_nothing(find):
    T = pose((170, 120), 0.6, 0.5)
    ones = np.ones((260, 346), np.float32)
    aside = Pose(np.stack([T.rotation] * 2), [[5, 0, 0.6], [0, -5, 0.6]])
    behind = Pose(np.stack([T.rotation] * 2), [[0, 0, -0.6], [0, 0, -0.6]])
    for pair in (aside, behind):
        assert find(ones, pair, PORT, CAMERA).score == 0


def test_one_normal_behind_the_camera_does_not_spoil_the_other():
    T = pose((170, 120), 0.6, 0.5, 1.0, 2.0)
    pair = Pose(np.stack([T.rotation] * 2), np.stack([-T.position_m, T.position_m]))
    for find in (yaw.fast_yaw, yaw.paper_yaw):
        fit = find(mask_of(T), pair, PORT, CAMERA)
        assert error_deg(fit.T_cam_port, T) < 1.5
        assert fit.rival_score == 0


@both
def test_misuse_is_named(find):
    pair = candidates(pose((170, 120), 0.6, 0.5))
    with pytest.raises(ValueError, match="reflector_mask: expected shape"):
        find(np.zeros((100, 100), np.float32), pair, PORT, CAMERA, OURS)
    with pytest.raises(ValueError, match="T_cam_port: expected two poses"):
        find(np.zeros((260, 346), np.float32), pair[0], PORT, CAMERA, OURS)


def test_the_score_is_the_share_of_the_markers_that_is_lit():
    T = pose((170, 120), 0.4, 0.5, 1.0, 2.0)
    mask = ideal_masks(T, PORT, CAMERA)[1]
    one_marker = projection.project(T @ PORT.marker_corners_m()[0], CAMERA)
    dark = cv2.fillConvexPoly(mask.copy(), np.round(one_marker).astype(np.int32), 0)
    batch = Pose(T.rotation[None], T.position_m[None])
    full, partly = (yaw.marker_score(m, batch, PORT, CAMERA)[0] for m in (mask, dark))
    assert partly / full == pytest.approx(2 / 3, abs=0.05)


def test_sigma_grows_with_noise_and_follows_the_error():
    errors, sigmas = {0.05: [], 0.3: []}, {0.05: [], 0.3: []}
    for k, T in enumerate(spread(20, 10, 45)):
        for noise in errors:
            fit = yaw.fast_yaw(mask_of(T, noise=noise, seed=k), candidates(T), PORT, CAMERA)
            errors[noise].append(np.deg2rad(error_deg(fit.T_cam_port, T)))
            sigmas[noise].append(fit.sigma_rad)
    assert np.median(sigmas[0.3]) > 1.5 * np.median(sigmas[0.05])
    assert all(np.mean(np.array(errors[n]) < 3 * np.array(sigmas[n])) > 0.9 for n in errors)


@both
def test_margin_is_small_where_the_normals_merge_and_large_where_they_part(find):
    margins = []
    for tilt_deg in (0.5, 5, 30):
        T = pose((170, 120), 0.45, np.deg2rad(tilt_deg), 1.0, 2.0)
        margins.append(find(mask_of(T), candidates(T), PORT, CAMERA).margin)
    assert 0 <= margins[0] < margins[1] < margins[2] <= 1
    assert margins[0] < 0.1
    assert margins[2] > 0.3


def test_a_yaw_is_unknown_where_another_explains_the_mask_as_well():
    """Markers at the true yaw, and fainter and fainter ones half a period on."""
    T, margins = pose((170, 120), 0.4, 0.3, 1.0, 2.0), []
    turned = Pose(T.rotation @ rotations.rotation_z(PORT.yaw_period_rad / 2), T.position_m)
    for share in (0.0, 0.4, 0.7, 0.95):
        fit = yaw.fast_yaw(np.maximum(mask_of(T), share * mask_of(turned)), candidates(T), PORT, CAMERA)
        assert (fit.yaw_margin >= OURS.min_yaw_margin) == (share < 0.9)
        margins.append(fit.yaw_margin)
        unknown_rad = PORT.yaw_period_rad / np.sqrt(12)
        assert (fit.sigma_rad == pytest.approx(unknown_rad)) == (fit.yaw_margin < OURS.min_yaw_margin)
    assert np.all(np.diff(margins) < -0.1) and 0 < margins[-1] < 0.05
    half = yaw.fast_yaw(0.5 * mask_of(T), candidates(T), PORT, CAMERA)
    assert half.yaw_margin == pytest.approx(margins[0])  # however bright they are


def test_an_empty_mask_knows_neither_yaw_nor_normal():
    fit = yaw.fast_yaw(np.zeros((260, 346), np.float32), candidates(pose((170, 120), 0.6, 0.5)), PORT, CAMERA)
    assert fit.margin == fit.yaw_margin == 0 < OURS.min_yaw_margin
    assert fit.sigma_rad == pytest.approx(PORT.yaw_period_rad / np.sqrt(12))


@both
@pytest.mark.parametrize("step", [0, 0.0, -1.0, 10.0, 1e-12, np.nan, np.inf, None, "1", [1.0]])
def test_steps_that_are_none(find, step):
    T = candidates(pose((170, 130), 0.5, 0.3, 0.0, 0.0))[:2]
    with pytest.raises(ValueError, match=r"yaw_step_rad: expected a number from .*, got "):
        find(np.ones(CAMERA.size_px[::-1], np.float32), T, PORT, CAMERA, replace(OURS, yaw_step_rad=step))
