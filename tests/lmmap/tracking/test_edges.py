"""Laws of the events at edges: derivatives, distances, what is visible, and what a gate keeps out."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from strategies import CAMERA, PORT, WIDE, pose, seeds, visible_poses

from lmmap.geometry.port import circle_points_m
from lmmap.geometry.projection import distort_points, project, undistort_points
from lmmap.tracking.edges import RING_BINS, EdgeFinder, Edges
from lmmap.types import EVENT, Pose

EDGES, FINDER = Edges.of(PORT), EdgeFinder(PORT, CAMERA)
EVERY = np.ones(len(EDGES.points_m), bool)


def moved(T, step) -> Pose:
    return Pose(Rotation.from_rotvec(step[3:]).as_matrix() @ T.rotation, T.position_m + step[:3])


def image_of(T, points_m, camera=CAMERA):
    return undistort_points(project(T @ points_m, camera), camera)


def normals(T, camera=CAMERA):
    """Images of the bins' points, and their outward normals by differences."""
    at = image_of(T, EDGES.points_m, camera)
    along = image_of(T, EDGES.points_m + 1e-6 * EDGES.tangents, camera) - at
    out = image_of(T, EDGES.points_m + 1e-6 * EDGES.outward, camera) - at
    n = np.stack([along[:, 1], -along[:, 0]], -1) / np.linalg.norm(along, axis=1, keepdims=True)
    return at, n * np.sign(np.sum(n * out, 1, keepdims=True))


def events_at(points_px, polarity=True):
    events = np.zeros(len(points_px), EVENT)
    events["x"], events["y"] = np.rint(points_px).astype(int).T
    events["p"] = polarity
    return events


def only(b):
    return np.arange(len(EVERY)) == b


@settings(max_examples=25)
@given(visible_poses(max_tilt_deg=60), st.sampled_from([CAMERA, WIDE]))
def test_the_jacobian_is_the_derivative_along_the_normal(T, camera):
    at, n = normals(T, camera)
    step = 1e-6
    shift = [image_of(moved(T, step * np.eye(6)[k]), EDGES.points_m, camera) - at for k in range(6)]
    expected = np.stack([np.sum(d * n, 1) / step for d in shift], -1)
    np.testing.assert_allclose(EDGES.jacobian(T, camera), expected, atol=1e-4 * np.abs(expected).max())


def test_moving_along_a_straight_edge_changes_nothing():
    T = pose((170, 130), 0.5, 0.3, 0.4)
    J = EDGES.jacobian(T, CAMERA)[:, :3]
    sides = slice(2 * RING_BINS, None)
    along = (T.rotation @ EDGES.tangents[sides].T).T
    assert np.abs(np.sum(J[sides] * along, 1)).max() < 1e-9 * np.abs(J).max()


@settings(max_examples=25)
@given(visible_poses(max_tilt_deg=50, max_distance_m=0.8), st.floats(-1.2, 1.2))
def test_an_event_is_as_far_from_its_edge_as_it_was_put(T, offset_px):
    at, n = normals(T)
    pixels = np.rint(at + offset_px * n)
    distance_px = np.sum((pixels - at) * n, 1)
    along_px = np.abs(np.sum((pixels - at) * n[:, ::-1] * [1, -1], 1))
    for b in np.flatnonzero(EDGES.visible(T, PORT, CAMERA))[::7]:
        count, sum_px = FINDER(events_at(pixels[b : b + 1]), T, only(b), 2.5)
        if count[1, b]:  # an event at the end of its bin may be the next one's
            assert abs(sum_px[1, b] - distance_px[b]) < 0.08
        else:
            assert along_px[b] > 0.2 or abs(distance_px[b]) > 2.4


@settings(max_examples=6)
@given(visible_poses(max_tilt_deg=50), seeds())
def test_the_gate_keeps_out_clutter(T, seed):
    """Oracle: the distance to edges that are drawn point by point."""
    rng, gate_px = np.random.default_rng(seed), 2.0
    rings = [circle_points_m(r, 1000) for r in (PORT.ring_inner_radius_m, PORT.ring_outer_radius_m)]
    corners, s = PORT.marker_corners_m(), np.linspace(0, 1, 200)[:, None]
    sides = [a + s * (b - a) for m in corners for a, b in zip(m, np.roll(m, -1, 0), strict=True)]
    edges_px = project(T @ np.concatenate(rings + sides), CAMERA)
    events = events_at(rng.uniform([0, 0], [345, 259], (150, 2)))
    pixels = np.stack([events["x"], events["y"]], -1)
    gap_px = np.min(np.linalg.norm(pixels[:, None] - edges_px, axis=-1), 1)
    counted = np.array([FINDER(events[k : k + 1], T, EVERY, gate_px)[0].sum() for k in range(150)])
    assert not counted[gap_px > 1.1 * gate_px].any()
    on_rings = np.min(np.linalg.norm(pixels[:, None] - edges_px[:2000], axis=-1), 1) < 0.9 * gate_px
    assert counted[on_rings].all()


def test_polarities_are_counted_apart_and_what_is_not_usable_not_at_all():
    T = pose((170, 130), 0.5, 0.3, 0.4)
    pixels = project(T @ EDGES.points_m[:1], CAMERA)
    for polarity in (0, 1):
        count, _ = FINDER(events_at(pixels, polarity), T, only(0), 2.5)
        assert count[polarity, 0] == count.sum() == 1
        assert FINDER(events_at(pixels, polarity), T, ~EVERY, 2.5)[0].sum() == 0


def test_plate_and_petals_hide_the_far_ring_and_no_marker_head_on():
    head_on = EDGES.visible(pose((172, 129), 0.6, 0.0), PORT, CAMERA)
    assert head_on.all()
    tilted = EDGES.visible(pose((172, 129), 0.6, np.deg2rad(60)), PORT, CAMERA)
    assert 0.3 < tilted[: 2 * RING_BINS].mean() < 0.95
    away = pose((172, 129), 0.6, 0.0)
    turned = Pose(away.rotation @ np.diag([1.0, -1, -1]), away.position_m)
    assert not EDGES.visible(turned, PORT, CAMERA).any()


def test_distances_are_those_without_distortion():
    T = pose((170, 130), 0.45, 0.4, 0.7, camera=WIDE)
    finder = EdgeFinder(PORT, WIDE)
    at, n = normals(T, WIDE)
    pixels = np.rint(distort_points(at + 0.5 * n, WIDE))
    distance_px = np.sum((undistort_points(pixels, WIDE) - at) * n, 1)
    for b in range(0, 2 * RING_BINS, 5):
        count, sum_px = finder(events_at(pixels[b : b + 1]), T, only(b), 2.5)
        assert count.sum() == 1 and abs(sum_px.sum() - distance_px[b]) < 0.1
