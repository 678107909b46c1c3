"""The paper's procedure on drawn masks, each intermediate checked by hand."""

import numpy as np
import pytest
from strategies import CAMERA, PORT, pose

from lmmap import PrintedEstimator
from lmmap.estimation.images import timed_images
from lmmap.geometry.conics import circle_ellipse
from lmmap.geometry.port import ideal_masks
from lmmap.geometry.rotations import rotation_z
from lmmap.pipeline.circle import paper_poses
from lmmap.pipeline.ellipse import paper_ransac
from lmmap.pipeline.ring import skeleton_points
from lmmap.pipeline.yaw import paper_yaw
from lmmap.settings import PAPER, Assumptions
from lmmap.types import EVENT, Pose, Recording, Status

NU = PORT.ring_radius_m
T = pose((190, 120), 0.5, np.deg2rad(35), 0.6, 0.4)
IMAGE = np.zeros((260, 346, 3), np.uint8)


def drawn(T_cam_port):
    """An estimator whose networks draw what they should find at a pose, and the two masks."""
    ring, markers = ideal_masks(T_cam_port, PORT, CAMERA)
    return PrintedEstimator(CAMERA, PORT, weights=(lambda _: ring, lambda _: markers)), ring, markers


def skeleton(mask):
    return skeleton_points(mask, Assumptions().mask_threshold, peak_share=0.0)


def angle_deg(a, b):
    return np.rad2deg(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def printed_poses(e, nearest=np.argmin):
    """The paper's section II.C, one line an equation, by its words: centre, and one normal for each end."""

    def bearing(x):
        v = np.linalg.solve(CAMERA.K, [*x, 1.0])
        return v / np.linalg.norm(v)

    along = np.array([np.cos(e.angle_rad), np.sin(e.angle_rad)])
    major, minor = e.semi_axes_px[0] * along, e.semi_axes_px[1] * np.array([-along[1], along[0]])
    M1, M2 = bearing(e.centre_px + major), bearing(e.centre_px - major)
    p = NU * (M1 + M2) / np.linalg.norm(M2 - M1)
    normals = []
    for end in (e.centre_px + minor, e.centre_px - minor):
        v = bearing(end)
        roots = np.real(np.roots([1.0, -2 * v @ p, p @ p - NU**2]))
        d = roots[nearest(roots)]
        n = np.cross(M2 - M1, d * v - p)
        n /= np.linalg.norm(n)
        normals.append(-n if n @ p > 0 else n)
    return p, normals


def test_the_skeleton_is_one_pixel_wide_and_lies_on_the_ring():
    ring = drawn(T)[1]
    points = skeleton(ring)
    assert len({tuple(x) for x in points}) == len(points) > Assumptions().min_ring_pixels
    rows, columns = points[:, 1].astype(int), points[:, 0].astype(int)
    assert np.all(ring[rows, columns] > 0.5)
    thin = np.zeros(ring.shape, bool)
    thin[rows, columns] = True
    assert not np.any(thin[1:, 1:] & thin[:-1, 1:] & thin[1:, :-1] & thin[:-1, :-1])


def test_one_threshold_keeps_weak_blobs_too():
    """Hysteresis, which is ours, would drop the ring beside a brighter blob."""
    ring = drawn(T)[1]
    mask = np.float32(0.6) * ring
    mask[2:10, 2:10] = 1.0
    points = skeleton(mask)
    assert len(points) > Assumptions().min_ring_pixels and (points > 20).all(1).any()


def test_the_ellipse_is_the_drawn_one():
    points = skeleton(drawn(T)[1])
    fit, _ = paper_ransac(points, np.random.default_rng(0), Assumptions())
    true = circle_ellipse(T, NU, CAMERA)
    np.testing.assert_allclose(fit.centre_px, true.centre_px, atol=1.0)
    np.testing.assert_allclose(fit.semi_axes_px, true.semi_axes_px, atol=1.0)


def test_centre_and_normals_are_the_printed_formulas():
    e = circle_ellipse(T, NU, CAMERA)
    candidates, (p, normals) = paper_poses(e, CAMERA, NU), printed_poses(e)
    for k in range(2):
        np.testing.assert_allclose(candidates[k].position_m, p, atol=1e-12)
        assert min(angle_deg(candidates[k].normal, n) for n in normals) < 1e-6
    assert angle_deg(*normals) > 10
    further = printed_poses(e, np.argmax)[1]
    assert min(angle_deg(candidates[0].normal, n) for n in further) > 1  # another reading, another normal


@pytest.mark.parametrize("range_m", [0.3, 0.6, 1.2])
def test_head_on_the_normal_is_off_by_twice_the_rings_angular_radius(range_m):
    head_on = Pose(np.diag([1.0, -1, -1]), [0, 0, range_m])
    candidates = paper_poses(circle_ellipse(head_on, NU, CAMERA), CAMERA, NU)
    bias_deg = np.rad2deg(2 * np.arctan(NU / range_m))
    for k in range(2):
        assert angle_deg(candidates[k].normal, head_on.normal) == pytest.approx(bias_deg, abs=1e-6)


def test_the_yaw_is_the_best_of_the_grid_on_both_normals():
    """With the true normal among the candidates the true yaw is found, in whole degrees of the grid."""
    markers = drawn(T)[2]
    rival = Pose(T.rotation @ np.diag([-1.0, 1, -1]) @ np.diag([1.0, -1, -1]), T.position_m)
    for degrees in (0, 7, 53, 119):
        turned = Pose(T.rotation @ rotation_z(-np.deg2rad(degrees)), T.position_m)
        both = Pose(np.stack([rival.rotation, turned.rotation]), np.stack([T.position_m] * 2))
        best = paper_yaw(markers, both, PORT, CAMERA).T_cam_port
        step = turned.rotation.T @ best.rotation
        steps_deg = np.rad2deg(np.arctan2(step[1, 0], step[0, 0])) % 120
        assert angle_deg(best.normal, T.normal) < 1e-6
        assert min(abs(steps_deg - degrees), 120 - abs(steps_deg - degrees)) <= 1 + 1e-6
        assert steps_deg == pytest.approx(round(steps_deg), abs=1e-6)


def test_whole_the_pose_is_near_and_as_biased_as_its_formula():
    estimator, *_ = drawn(T)
    estimate = estimator(IMAGE, 7)
    p, normals = printed_poses(circle_ellipse(T, NU, CAMERA))
    assert (estimate.t_us, estimate.status) == (7, Status.OK)
    assert np.linalg.norm(estimate.T_cam_port.position_m - p) < 0.02
    bias_deg = min(angle_deg(n, T.normal) for n in normals)
    assert abs(angle_deg(estimate.T_cam_port.normal, T.normal) - bias_deg) < 3
    assert estimate.covariance is None and estimate.printed is None


def test_what_fails_has_its_status():
    estimator, ring, markers = drawn(T)
    few = PrintedEstimator(CAMERA, PORT, weights=(lambda _: 0 * ring, lambda _: markers))
    assert few(IMAGE).status == Status.NO_RING
    line = np.zeros_like(ring)
    line[100:103, 20:320] = 1
    flat = PrintedEstimator(CAMERA, PORT, weights=(lambda _: line, lambda _: markers))
    assert flat(IMAGE).status == Status.NO_ELLIPSE
    with pytest.raises(ValueError, match=r"image: expected .* got \(100, 346, 3\)"):
        estimator(IMAGE[:100])
    with pytest.raises(ValueError, match="modality"):
        PrintedEstimator(modality="lidar")


def test_n_events_are_looked_at_once():
    ring = np.zeros((260, 346))
    estimator = PrintedEstimator(CAMERA, PORT, "event", weights=(lambda _: ring, lambda _: ring))
    events = np.zeros(3 * PAPER.events_per_window, EVENT)
    events["t_us"] = np.arange(len(events))
    recording = Recording("r", CAMERA, events, np.zeros((0, 260, 346, 3), np.uint8), np.zeros(0, np.int64))
    images = list(timed_images(recording, "event", estimator.settings))
    assert [image.wider for image in images] == [None] * 3
    assert all(image.image.sum() == PAPER.events_per_window for image in images)
