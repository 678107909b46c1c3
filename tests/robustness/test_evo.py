"""EVO (`benchmarks/vo/evo`): laws of its parts, and a short sequence that it must follow."""

import inspect
import re
import time
from dataclasses import fields, replace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from vo.evo import bootstrap, constants, event_frames, mapping, odometry, scenes, sweep, tracking
from vo.evo.constants import Constants
from vo.evo.mapper import Mapper
from vo.evo.stopwatch import Stopwatch

from lmmap.geometry.rotations import rotation_angle_rad
from lmmap.types import Camera, Pose
from lmmap_lab.studies.trajectory_errors import umeyama

CAMERA = Camera(120, 90, 110.0, 110.0, 59.5, 44.5)
CONSTANTS = Constants()


def test_each_constant_says_where_it_comes_from():
    source = inspect.getsource(constants)
    for name in (f.name for f in fields(Constants)):
        assert re.search(rf"^    {name}: .*# .*(EVO|EMVS|released|open)", source, re.MULTILINE), name


def events_of(points, positions, packet_events):
    """Events of points (N, 3) seen from camera positions (P, 3), unrotated: one packet a position."""
    rng, x, y = np.random.default_rng(0), [], []
    for position in positions:
        pixel = (points - position) @ CAMERA.K.T
        u, v = np.rint(pixel[:, :2] / pixel[:, 2:]).astype(int).T
        inside = (u >= 0) & (v >= 0) & (u < CAMERA.width_px) & (v < CAMERA.height_px)
        chosen = rng.choice(np.flatnonzero(inside), packet_events)
        x.append(u[chosen])
        y.append(v[chosen])
    return np.concatenate(x).astype(np.int16), np.concatenate(y).astype(np.int16)


@pytest.mark.parametrize("far_m", [2.0, 3.0], ids=["plane", "step"])
def test_the_space_sweep_finds_a_plane_and_a_step(far_m):
    """Vertical edges at 2 m on the left and ``far_m`` on the right; the camera slides by 0.4 m."""
    slopes = np.array([-0.42, -0.30, -0.17, 0.15, 0.28, 0.41])
    depth_m = np.where(slopes < 0, 2.0, far_m)
    y = np.linspace(-0.3, 0.3, 60)
    points = np.concatenate([np.stack([np.full(60, s), y, np.ones(60)], -1) * d
                             for s, d in zip(slopes, depth_m, strict=True)])  # fmt: skip
    positions = np.stack([np.linspace(-0.2, 0.2, 120), np.zeros(120), np.linspace(0.05, -0.05, 120)], -1)
    x, y = events_of(points, positions, CONSTANTS.packet_events)
    planes = sweep.inverse_depths(1.0, 8.0, 100)
    rotation = np.tile(np.eye(3), (len(positions), 1, 1))
    dsi = sweep.space_sweep(
        x, y, rotation, positions, CAMERA.K, CAMERA.size_px, planes, CONSTANTS.packet_events
    )
    depth = mapping.extract(dsi, planes, CONSTANTS).depth
    left, right = depth[:, : CAMERA.width_px // 2], depth[:, CAMERA.width_px // 2 :]
    for side, true_m in ((left, 2.0), (right, far_m)):
        assert (side > 0).sum() > 60
        assert np.median(np.abs(side[side > 0] / true_m - 1)) < 0.02
        assert np.mean(np.abs(side[side > 0] / true_m - 1)) < 0.06


def test_an_edge_along_the_motion_is_not_mapped():
    """Its rays meet in all planes alike; an edge across the motion beside it is mapped."""
    along = np.stack([np.linspace(-1.5, 1.5, 400), np.full(400, -0.3), np.full(400, 2.0)], -1)
    across = np.stack([np.zeros(400), np.linspace(0.1, 0.6, 400), np.full(400, 2.0)], -1)
    positions = np.stack([np.linspace(-0.2, 0.2, 120), np.zeros(120), np.zeros(120)], -1)
    x, y = events_of(np.concatenate([along, across]), positions, CONSTANTS.packet_events)
    planes, rotation = sweep.inverse_depths(1.0, 8.0, 100), np.tile(np.eye(3), (len(positions), 1, 1))
    dsi = sweep.space_sweep(
        x, y, rotation, positions, CAMERA.K, CAMERA.size_px, planes, CONSTANTS.packet_events
    )
    depth = mapping.extract(dsi, planes, CONSTANTS).depth
    v = np.nonzero(depth)[0]
    assert len(v) > 20 and v.min() > 45
    np.testing.assert_allclose(depth[depth > 0], 2.0, rtol=0.03)


def test_a_homography_gives_its_plane():
    normal = np.array([0.3, -0.1, 1.0]) / np.linalg.norm([0.3, -0.1, 1.0])
    R, t, distance = (
        tracking.exponential(np.array([0, 0, 0, 0.02, 0.05, -0.03]))[0],
        np.array([0.2, 0.1, 0.02]),
        2.0,
    )
    H = CAMERA.K @ (R + np.outer(t, normal) / distance) @ np.linalg.inv(CAMERA.K)
    plane = bootstrap.plane(H, CAMERA.K, CAMERA.size_px)
    np.testing.assert_allclose(plane, normal / distance * np.linalg.norm(t), rtol=1e-6)
    turn = CAMERA.K @ R @ np.linalg.inv(CAMERA.K)
    assert bootstrap.plane(turn, CAMERA.K, CAMERA.size_px) is None


def test_a_tilted_plane_is_read_off_event_frames():
    """Depth of a textured plane that leans by 31 deg, seen from a camera that slides and turns."""
    rng, own = np.random.default_rng(3), Constants(events_per_frame=1500)
    a, b = rng.uniform(-1.5, 1.5, (2, 60, 1)), 0.25 * np.linspace(-1, 1, 40)
    angle = rng.uniform(0, np.pi, (60, 1))
    X, Y = (a[0] + b * np.cos(angle)).ravel(), (a[1] + b * np.sin(angle)).ravel()
    points = np.stack([X, Y, 2.0 + 0.6 * X], -1)
    x, y = [], []
    for share in np.linspace(0, 1, 40):
        R = tracking.exponential(np.array([0, 0, 0, 0.02, -0.03, 0.04]) * share)[0]
        pixel = (points - share * np.array([0.5, 0.2, 0.0])) @ (CAMERA.K @ R).T
        u, v = np.rint(pixel[:, :2] / pixel[:, 2:]).astype(int).T
        inside = (pixel[:, 2] > 0) & (u >= 0) & (v >= 0) & (u < CAMERA.width_px) & (v < CAMERA.height_px)
        chosen = rng.choice(np.flatnonzero(inside), 1500)
        x.append(u[chosen])
        y.append(v[chosen])
    depth = bootstrap.planar_depth(np.concatenate(x), np.concatenate(y), 0, CAMERA.K, CAMERA.size_px, own)
    u, v = np.meshgrid(np.arange(CAMERA.width_px), np.arange(CAMERA.height_px))
    true = 1 / (1 - 0.6 * (u - CAMERA.K[0, 2]) / CAMERA.K[0, 0])
    np.testing.assert_allclose(depth / depth[45, 60], true / true[45, 60], rtol=0.12)


def test_a_ray_votes_once_in_every_plane_that_it_crosses_in_view():
    planes = sweep.inverse_depths(1.0, 4.0, 20)
    x = y = np.array([60, 50, 40, 61], np.int16)
    dsi = sweep.space_sweep(x, y, np.eye(3)[None], np.zeros((1, 3)), CAMERA.K, CAMERA.size_px, planes, 4)
    np.testing.assert_allclose(dsi.sum((1, 2)), 4, rtol=1e-5)
    assert dsi[:, 60, 60] == pytest.approx(np.ones(20), abs=1e-3)


def test_votes_are_bilinear_and_rays_outside_have_none():
    planes, centre = sweep.inverse_depths(1.0, 4.0, 3), np.array([[0.003, -0.002, 0.0]])
    x, y = np.array([60, 0], np.int16), np.array([50, 89], np.int16)
    dsi = sweep.space_sweep(x, y, np.eye(3)[None], centre, CAMERA.K, CAMERA.size_px, planes, 2)
    u, v = 60 + CAMERA.fx_px * 0.003 * planes, 50 - CAMERA.fy_px * 0.002 * planes
    rows, columns = np.indices(dsi.shape[1:])
    tents = [np.maximum(1 - np.abs(columns - a), 0) * np.maximum(1 - np.abs(rows - b), 0)
             for a, b in zip(u, v, strict=True)]  # fmt: skip
    dsi[:, 86:, :5] = 0  # of the second ray, at the image's edge
    np.testing.assert_allclose(dsi, tents, atol=1e-4)


def test_the_warp_s_jacobian_is_that_of_finite_differences():
    rng = np.random.default_rng(1)
    points = rng.uniform([-1, -1, 1], [1, 1, 4], (50, 3))

    def pixels(xi):
        R, t = tracking.exponential(xi)
        moved = (points @ R.T + t) @ CAMERA.K.T
        return moved[:, :2] / moved[:, 2:]

    steps = 1e-6 * np.eye(6)
    numeric = np.stack([(pixels(s) - pixels(-s)) / 2e-6 for s in steps], -1)
    np.testing.assert_allclose(tracking.warp_jacobian(points, CAMERA.K), numeric, rtol=1e-5, atol=1e-4)


def test_the_exponential_is_a_rotation_by_its_angle():
    xi = np.array([0.3, -0.2, 0.1, 0.4, -0.5, 0.6])
    R, t = tracking.exponential(xi)
    np.testing.assert_allclose(R, Rotation.from_rotvec(xi[3:]).as_matrix(), atol=1e-12)
    back, t_back = tracking.exponential(-xi)
    np.testing.assert_allclose(R @ t_back + t, 0, atol=1e-12)
    np.testing.assert_allclose(R @ back, np.eye(3), atol=1e-12)


def test_alignment_finds_the_pose_that_an_image_was_made_from():
    rng = np.random.default_rng(2)
    corners = rng.uniform([-0.9, -0.7, 1.5], [0.9, 0.7, 3.0], (40, 3))
    points = np.concatenate([corners + a * rng.normal(0, 0.1, (40, 3)) for a in np.linspace(0, 1, 30)])
    args = CAMERA.K, CAMERA.size_px, CONSTANTS
    reference = tracking.project_map(points, np.eye(3), np.zeros(3), *args)
    true_R, true_t = tracking.exponential(np.array([0.02, -0.01, 0.015, 0.008, -0.006, 0.01]))
    pixel = (points @ true_R.T + true_t) @ CAMERA.K.T
    u, v = np.rint(pixel[:, :2] / pixel[:, 2:]).astype(int).T
    inside = (u >= 0) & (v >= 0) & (u < CAMERA.width_px) & (v < CAMERA.height_px)
    image = event_frames.event_frame(u[inside], v[inside], CAMERA.size_px, 1, CONSTANTS.reference_blur_px)
    R, t, similarity, _ = tracking.align(image, reference, np.eye(3), np.zeros(3), CAMERA.K, CONSTANTS)
    # points are drawn at whole pixels, of 0.5 deg
    assert np.linalg.norm(t - true_t) < 0.01 and np.rad2deg(rotation_angle_rad(R @ true_R.T)) < 0.3
    assert similarity > 0.8


def test_an_event_frame_counts_up_to_its_limit():
    x, y = np.array([3, 3, 3, 7]), np.array([2, 2, 2, 5])
    image = event_frames.event_frame(x, y, (12, 9), 2, 0)
    assert image.shape == (9, 12) and image[2, 3] == 2 and image[5, 7] == 1 and image.sum() == 3


def test_lens_distortion_is_refused():
    with pytest.raises(ValueError, match="distortion"):
        odometry.Odometry(Camera(120, 90, 110.0, 110.0, 59.5, 44.5, (0.1, 0, 0, 0)))


SCENE, SCENE_CAMERA = scenes.scene("boxes-fast"), Camera(173, 130, 162.0, 162.0, 86.0, 64.5)
SCENE_CONSTANTS = Constants(
    events_per_frame=1500, events_per_step=1000, bootstrap_events=3000, map_points=200
)


@pytest.fixture(scope="module")
def scene_events():
    return scenes.simulate(SCENE, SCENE_CAMERA, 2.0).events


def first_depth_m(events):
    start = scenes.motion(SCENE, [events["t_us"][1500] * 1e-6])[0]
    return cv2.erode(
        scenes.depth_image(SCENE, start, SCENE_CAMERA), np.ones((3, 3))
    )  # an edge is the nearer's


def test_two_seconds_of_a_scene_are_tracked(scene_events):
    """From the true depth of the first view, so that tracking and mapping are seen without the bootstrap."""
    depth_m = first_depth_m(scene_events)
    (track,) = odometry.Odometry(SCENE_CAMERA, SCENE_CONSTANTS).run(scene_events, depth_m)
    assert not track.lost and len(track.keyframes) >= 2
    estimate = Pose(np.array(track.rotation), np.array(track.position)).inverse
    truth = scenes.motion(SCENE, np.array(track.t_us) * 1e-6).inverse
    scale, R, t = umeyama(estimate.position_m, truth.position_m)
    error_m = np.linalg.norm(scale * estimate.position_m @ R.T + t - truth.position_m, axis=1)
    assert np.ptp(truth.position_m, axis=0).max() > 0.3
    assert error_m.mean() < 0.015 * np.median(depth_m) and scale == pytest.approx(1, abs=0.1)
    turned = [np.swapaxes(T.rotation[0], -1, -2) @ T.rotation for T in (estimate, truth)]
    assert np.rad2deg(rotation_angle_rad(np.swapaxes(turned[0], -1, -2) @ turned[1])).mean() < 2


class SlowMapper(Mapper):
    def _timed(self, stretch):
        time.sleep(0.1)
        return super()._timed(stretch)


def test_poses_do_not_depend_on_how_long_a_map_takes(scene_events):
    tracks = []
    for mapper in (Mapper, SlowMapper):
        evo = odometry.Odometry(SCENE_CAMERA, replace(SCENE_CONSTANTS, map_frames=25))
        evo._mapper = mapper(evo.K, evo.size_px, evo.constants)
        tracks += evo.run(scene_events, first_depth_m(scene_events))
    quick, slow = tracks
    assert quick.keyframes and len(quick.keyframes) == len(slow.keyframes)
    np.testing.assert_array_equal(quick.position, slow.position)
    np.testing.assert_array_equal(quick.rotation, slow.rotation)


def test_two_cores_wait_only_for_maps_that_are_late():
    times = Stopwatch()
    times.track(1.0, bootstrapping=False)
    times.begin_map()
    times.track(1.0, bootstrapping=False)
    times.take_map(0.5, bootstrapping=False)  # was ready
    assert times.two_cores_s == 2.0
    times.begin_map()
    times.track(1.0, bootstrapping=False)
    times.take_map(3.0, bootstrapping=False)
    assert (times.two_cores_s, times.tracking_s, times.mapping_s, times.frames) == (5.0, 3.0, 3.5, 3)
    times.take_map(9.0, bootstrapping=True)
    assert times.two_cores_s == 5.0 and times.bootstrap_s == 9.0
