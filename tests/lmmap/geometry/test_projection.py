import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from strategies import CAMERA, PORT, WIDE, ellipses, pose, rotations, visible_poses

from lmmap.geometry import conics, projection
from lmmap.geometry.port import circle_points_m, ideal_masks, in_view, on_plane
from lmmap.geometry.rotations import rotation_angle_rad, rotation_between_rad, rotation_z
from lmmap.types import Ellipse, Pose

pixels = st.tuples(st.floats(0, 345), st.floats(0, 259)).map(np.array)


@pytest.mark.parametrize("camera", [CAMERA, WIDE], ids=["pinhole", "distorted"])
@given(point=pixels, depth=st.floats(0.1, 10))
def test_projection_undoes_bearings(camera, point, depth):
    back = projection.project(depth * projection.bearings(point, camera), camera)
    np.testing.assert_allclose(back, point, atol=1e-7)


@given(st.tuples(*[st.floats(-0.4, 0.4)] * 2), st.floats(0.3, 2))
def test_distorted_projection_is_opencvs(xy, depth):
    p = np.array([*xy, 1]) * depth
    expected = cv2.projectPoints(p[None], np.zeros(3), np.zeros(3), WIDE.K, np.array(WIDE.distortion))[0]
    np.testing.assert_allclose(projection.project(p, WIDE), expected[0, 0], atol=1e-9)


def test_points_behind_the_camera_have_no_pixel():
    assert np.isnan(projection.project([[0, 0, -1], [0, 0, 0]], CAMERA)).all()


def test_pixel_centres_stay_centres_when_an_image_is_rescaled():
    # the centre of a 4-pixel row is 1.5, of the same row at double size 3.5
    np.testing.assert_allclose(projection.rescale_px([1.5, -0.5], 2), [3.5, -0.5])


@given(ellipses(max_ratio=0.98))
def test_ellipse_to_conic_and_back(ellipse):
    back, real = conics.ellipse_from_conic(conics.conic_from_ellipse(ellipse))
    assert real
    np.testing.assert_allclose(back.centre_px, ellipse.centre_px, atol=1e-7)
    np.testing.assert_allclose(back.semi_axes_px, ellipse.semi_axes_px, rtol=1e-8)
    turn = (back.angle_rad - ellipse.angle_rad + np.pi / 2) % np.pi - np.pi / 2
    np.testing.assert_allclose(turn, 0, atol=1e-6)


@given(ellipses())
def test_points_of_an_ellipse_lie_on_its_conic(ellipse):
    x = np.column_stack([ellipse.points(16), np.ones(16)])
    C = conics.conic_from_ellipse(ellipse)
    np.testing.assert_allclose(np.einsum("ni,ij,nj->n", x, C, x), 0, atol=1e-9)


@pytest.mark.parametrize(
    "C", [np.diag([1.0, -1, -1]), np.diag([1.0, 1, 1]), np.diag([1.0, 0, -1]), np.zeros((3, 3))]
)
def test_hyperbolas_imaginary_ellipses_and_lines_are_no_ellipses(C):
    ellipse, real = conics.ellipse_from_conic(C)
    assert not real
    assert np.isnan(ellipse.semi_axes_px).all()


@given(visible_poses())
def test_the_circles_ellipse_passes_through_its_projected_points(T):
    points = projection.project(circle_points_m(0.08) @ T.rotation.T + T.position_m, CAMERA)
    C = conics.conic_from_ellipse(conics.circle_ellipse(T, 0.08, CAMERA))
    x = np.column_stack([points, np.ones(len(points))])
    gradient = np.linalg.norm(2 * (x @ C)[:, :2], axis=1)
    np.testing.assert_allclose(np.einsum("ni,ij,nj->n", x, C, x) / gradient, 0, atol=1e-8)


@given(pixels, st.floats(0, 1))
def test_undistorted_pixels_project_without_distortion(point, depth):
    rays = projection.bearings(point, WIDE) * (0.1 + depth)
    expected = rays[:2] / rays[2] * [WIDE.fx_px, WIDE.fy_px] + [WIDE.cx_px, WIDE.cy_px]
    np.testing.assert_allclose(projection.undistort_points(point, WIDE), expected, atol=1e-9)


@given(rotations())
def test_rotation_angles_are_scipys(R):
    np.testing.assert_allclose(rotation_angle_rad(R), Rotation.from_matrix(R).magnitude(), atol=1e-7)


@given(rotations(), st.integers(-3, 3), st.floats(-1, 1))
def test_orientations_are_compared_modulo_the_symmetry(R, turns, extra):
    period = PORT.yaw_period_rad
    turned = R @ rotation_z(turns * period + extra)
    np.testing.assert_allclose(rotation_between_rad(R, turned, period), abs(extra), atol=1e-7)


def test_the_ring_leaves_the_view_when_it_touches_the_border_or_turns_its_back():
    middle = pose((172.5, 129.5), 0.6, 0.2)
    assert in_view(middle, PORT, CAMERA)
    assert not in_view(pose((20, 129.5), 0.6, 0.2), PORT, CAMERA)
    assert not in_view(pose((172.5, 129.5), 0.15, 0.0), PORT, CAMERA)
    back = Pose(middle.rotation @ np.diag([1.0, -1, -1]), middle.position_m)
    assert not in_view(back, PORT, CAMERA)
    batch = Pose(np.stack([middle.rotation] * 2), np.stack([middle.position_m, -middle.position_m]))
    assert in_view(batch, PORT, CAMERA).tolist() == [True, False]


@given(visible_poses(), st.tuples(*[st.floats(-0.05, 0.05)] * 2), st.floats(0, 0.05))
def test_lines_of_sight_meet_the_plane_where_the_point_is(T, xy, height):
    pixel = projection.project(T @ np.array([*xy, height]), WIDE)
    np.testing.assert_allclose(on_plane(pixel, T, height, WIDE), xy, atol=1e-7)


def test_ideal_masks_have_the_projected_areas():
    T = pose((170, 120), 0.6, 0.5, 1.0, 0.4)
    ring, markers = ideal_masks(T, PORT, CAMERA)
    outer, inner = (
        np.prod(conics.circle_ellipse(T, r, CAMERA).semi_axes_px) * np.pi
        for r in (PORT.ring_outer_radius_m, PORT.ring_inner_radius_m)
    )
    assert ring.sum() == pytest.approx(outer - inner, rel=2e-3)
    corners = projection.project((PORT.marker_corners_m() @ T.rotation.T) + T.position_m, CAMERA)
    area = sum(cv2.contourArea(c.astype(np.float32)) for c in corners)
    assert markers.sum() == pytest.approx(area, rel=5e-3)
    assert ring.dtype == np.float32
    assert 0 <= markers.min() < markers.max() <= 1


def test_circles_become_ellipses_of_the_known_size_on_the_axis():
    # fronto-parallel at distance Z: a circle of radius f r / Z
    ellipse = conics.circle_ellipse(pose((172.5, 129.5), 0.6, 0.0), 0.08, CAMERA)
    np.testing.assert_allclose(ellipse.semi_axes_px, 324 * 0.08 / 0.6)
    np.testing.assert_allclose(ellipse.centre_px, [172.5, 129.5])
    assert isinstance(ellipse, Ellipse)


@pytest.mark.parametrize(
    "position", [[5, 0, 0.6], [0, 0, -0.6], [0, 0, 0.02]], ids=["aside", "behind", "around"]
)
def test_masks_of_a_port_out_of_view_are_empty_or_finite(position):
    masks = ideal_masks(Pose(pose((172.5, 129.5), 0.6, 0.3).rotation, position), PORT, CAMERA, 1)
    assert np.all(np.isfinite(masks))
    assert masks.shape == (2, 260, 346)
    assert position[2] == 0.02 or masks.sum() == 0
