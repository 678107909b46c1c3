"""Ring and markers together, on masks drawn from the geometry."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from strategies import CAMERA, PORT, WIDE, pose

from lmmap.geometry import conics, projection
from lmmap.geometry.port import ideal_masks
from lmmap.geometry.rotations import rotation_between_rad
from lmmap.pipeline import circle, yaw
from lmmap.pipeline.refine import ring_edges
from lmmap.pipeline.setup import Setup
from lmmap.refinement import contour, joint
from lmmap.types import Pose

RING_PX, MARKER_PX = 0.5, 0.7
HIGHER = replace(PORT, plate_height_m=1.2 * PORT.plate_height_m)


def masks_of(T, seed, camera=CAMERA, port=PORT):
    rng = np.random.default_rng(seed)
    masks = [cv2.GaussianBlur(m, (0, 0), 0.8) for m in ideal_masks(T, port, camera)]
    return [(m + 0.05 * rng.standard_normal(m.shape)).clip(0, 1).astype(np.float32) for m in masks]


def circle_of(points_px):
    """The ring's centre line alone."""
    return [joint.RingEdge(points_px, np.full(len(points_px), RING_PX), PORT.ring_radius_m, 0)]


def solved(T, seed, camera=CAMERA, port=PORT):
    """The pose of ring and yaw, and the joint refinement of it; with the standard port, of this one."""
    ring, markers = masks_of(T, seed, camera, port)
    start = conics.circle_ellipse(T, PORT.ring_radius_m, camera)
    traced = contour.trace(start, ring, 0.25 * start.semi_axes_px[0], camera)
    pair = circle.poses(traced.ellipse, camera, PORT.ring_radius_m)
    fit = yaw.fast_yaw(markers, pair, PORT, camera)
    edges = ring_edges(traced, Setup(PORT, camera, "rgb"))
    return fit.T_cam_port, joint.refine(fit.T_cam_port, edges, markers, PORT, camera, MARKER_PX)


def error(T, truth):
    angle = rotation_between_rad(T.rotation, truth.rotation, PORT.yaw_period_rad)
    return np.rad2deg(angle), 1e3 * np.linalg.norm(T.position_m - truth.position_m)


def test_head_on_it_cuts_the_error_and_elsewhere_it_does_no_harm():
    errors = {0: [], 1: []}
    for k, tilt_deg in enumerate([0, 1, 2, 3, 5, 8, 12, 20, 30, 45]):
        T = pose((180, 120), 0.5, np.deg2rad(tilt_deg), 0.6 * k, 0.4 * k)
        for j, estimated in enumerate((solved(T, k)[0], solved(T, k)[1].T_cam_port)):
            errors[j].append(error(estimated, T))
    before, after = (np.array(errors[k]) for k in (0, 1))
    assert np.sqrt(np.mean(after[:5, 0] ** 2)) < 0.7 * np.sqrt(np.mean(before[:5, 0] ** 2))
    assert np.all(after[:, 0] < 0.8)
    assert np.all(after[:, 1] < 3)


@pytest.mark.parametrize("camera", [CAMERA, WIDE], ids=["plain", "distorted"])
def test_it_returns_from_a_disturbed_start(camera):
    T = pose((180, 120), 0.5, np.deg2rad(20), 1.0, 2.0)
    markers = masks_of(T, 0, camera)[1]
    points = conics.circle_ellipse(T, PORT.ring_radius_m, camera).points(150)
    turn = Rotation.from_rotvec(np.deg2rad([2.0, -1.5, 1.0])).as_matrix()
    start = Pose(turn @ T.rotation, T.position_m + np.array([0.002, -0.001, 0.004]))
    refined = joint.refine(start, circle_of(points), markers, PORT, camera, MARKER_PX)
    assert refined.edges > 60
    assert np.all(np.array(error(refined.T_cam_port, T)) < [0.5, 2.0])


def test_a_mask_that_is_too_wide_on_all_sides_turns_nothing():
    T = pose((180, 120), 0.4, np.deg2rad(20), 1.0, 2.0)
    points = conics.circle_ellipse(T, PORT.ring_radius_m, CAMERA).points(150)
    wide = cv2.dilate(masks_of(T, 0)[1], np.ones((3, 3), np.uint8))
    refined = joint.refine(T, circle_of(points), wide, PORT, CAMERA, MARKER_PX)
    assert np.all(np.array(error(refined.T_cam_port, T)) < [0.5, 2.0])


def test_the_covariance_is_one_and_better_than_the_rings_alone():
    T = pose((180, 120), 0.5, np.deg2rad(3), 1.0, 2.0)
    _, refined = solved(T, 0)
    assert np.all(np.linalg.eigvalsh(refined.covariance) > 0)
    tilt_deg = np.rad2deg(np.sqrt(np.linalg.eigvalsh(refined.covariance[3:6, 3:6])))
    assert np.all(tilt_deg < 1.5)


def test_without_markers_there_is_nothing_to_join():
    T = pose((180, 120), 0.5, 0.3)
    points = conics.circle_ellipse(T, PORT.ring_radius_m, CAMERA).points(150)
    for mask in (np.zeros((260, 346)), np.ones((260, 346))):
        assert joint.refine(T, circle_of(points), mask, PORT, CAMERA, MARKER_PX) is None


def test_a_covariance_grows_as_the_markers_fade():
    unit = np.eye(6)
    np.testing.assert_allclose(joint.inflate(unit, 1.0, 1.5, 0.7), 1.5 * unit)
    np.testing.assert_allclose(joint.inflate(unit, 0.5, 1.5), 4 * 1.5 * unit)
    np.testing.assert_allclose(joint.inflate(unit, 0.25, 2.0, 0.5), 2 * 2.0 * unit)
    np.testing.assert_array_equal(joint.inflate(unit, 0.25, 2.0, 0.0), 2.0 * unit)


@pytest.mark.parametrize("tilt_deg", [20, 40])
def test_of_a_higher_plate_the_pose_is_right_and_the_port_is_off(tilt_deg):
    """The plate is a fifth higher than the port that is refined with."""
    T = pose((180, 120), 0.45, np.deg2rad(tilt_deg), 1.0, 2.0)
    off = [solved(T, 0, port=port)[1] for port in (PORT, HIGHER)]
    assert np.all(np.array(error(off[1].T_cam_port, T)) < [0.6, 2.0])
    tolerances = 0.2 / PORT.plate_height_tolerance
    assert abs(off[0].port_off[0]) < 0.1 * tolerances and off[1].port_off[0] > 0.6 * tolerances
    px = [joint.markers_off_px(fit.T_cam_port, fit.port_off, PORT, CAMERA) for fit in off]
    seen = projection.project(T @ np.stack([p.marker_corners_m() for p in (PORT, HIGHER)]), CAMERA)
    away_px = np.sqrt(np.mean(np.sum(np.diff(seen, axis=0) ** 2, -1)))
    assert px[0] < 0.3 and px[1] == pytest.approx(away_px, rel=0.4)


def test_tolerances_are_in_the_covariance():
    """A plate of unknown height leaves the tilt to the ring; one that is known does not."""
    T = pose((180, 120), 0.5, np.deg2rad(30), 1.0, 2.0)
    markers, points = masks_of(T, 0)[1], conics.circle_ellipse(T, PORT.ring_radius_m, CAMERA).points(150)
    known, drawn, unknown = (
        joint.refine(
            T, circle_of(points), markers, replace(PORT, plate_height_tolerance=t), CAMERA, MARKER_PX
        )
        for t in (0.001, PORT.plate_height_tolerance, 0.5)
    )
    assert np.all(np.linalg.eigvalsh((drawn.covariance - known.covariance)[:6, :6]) > -1e-12)
    assert np.all(np.linalg.eigvalsh((unknown.covariance - drawn.covariance)[:6, :6]) > -1e-12)
    assert np.trace(drawn.covariance[3:6, 3:6]) > 1.1 * np.trace(known.covariance[3:6, 3:6])


def test_a_ring_mask_that_is_wider_on_both_sides_moves_nothing():
    T = pose((180, 120), 0.45, np.deg2rad(25), 1.0, 2.0)
    ring, markers = masks_of(T, 0)
    start = conics.circle_ellipse(T, PORT.ring_radius_m, CAMERA)
    wide = cv2.dilate(ring, np.ones((3, 3), np.uint8))
    edges = ring_edges(contour.trace(start, wide, 0.3 * start.semi_axes_px[0]), Setup(PORT, CAMERA, "rgb"))
    refined = joint.refine(T, edges, markers, PORT, CAMERA, MARKER_PX)
    assert np.all(np.array(error(refined.T_cam_port, T)) < [0.5, 1.5])
    alone = joint.refine(T, [edges[1]], markers, PORT, CAMERA, MARKER_PX)
    assert error(alone.T_cam_port, T)[1] > 2.0  # one edge alone does not know how wide the mask is
