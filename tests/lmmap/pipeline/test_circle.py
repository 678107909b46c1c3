import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from strategies import CAMERA, ellipses, pose, visible_poses

from lmmap.geometry import conics, rotations
from lmmap.pipeline import circle
from lmmap.types import Camera, Ellipse, Pose

NU = 0.08
both = pytest.mark.parametrize("solve", [circle.poses, circle.paper_poses], ids=["exact", "paper"])


def errors(solve, T, camera=CAMERA):
    """Normal (deg) and position (mm) error of the better branch."""
    solved = solve(conics.circle_ellipse(T, NU, camera), camera, NU)
    normal = np.rad2deg(rotations.angle_between_rad(solved.normal, T.normal))
    position = 1e3 * np.linalg.norm(solved.position_m - T.position_m, axis=-1)
    return normal.min(), position[normal.argmin()]


@given(visible_poses(max_tilt_deg=75))
@example(pose((172.5, 129.5), 0.6, 0.0))
@example(pose((172.5, 129.5), 0.6, 1e-4))
@example(pose((100, 90), 0.6, 1e-3, 0.3))
def test_the_true_pose_is_one_of_the_two(T):
    normal, position = errors(circle.poses, T)
    assert normal < 1e-5  # in double precision the tilt is only known to sqrt(epsilon) near 0 deg
    assert position < 1e-6


@given(visible_poses(min_tilt_deg=3))
def test_away_from_fronto_parallel_the_recovery_is_exact(T):
    normal, position = errors(circle.poses, T)
    assert normal < 1e-8
    assert position < 1e-9


@given(ellipses(min_ratio=0.2))
def test_both_poses_reproject_to_the_same_ellipse(ellipse):
    solved = circle.poses(ellipse, CAMERA, NU)
    C = conics.circle_conic(solved, NU, CAMERA)
    expected = conics.conic_from_ellipse(ellipse)
    np.testing.assert_allclose(C * np.sign(C[:, :1, :1]), [expected, expected], atol=1e-10)


@both
@given(ellipse=ellipses())
def test_poses_are_proper_and_face_the_camera(solve, ellipse):
    solved = solve(ellipse, CAMERA, NU)
    R = solved.rotation
    np.testing.assert_allclose(np.swapaxes(R, -1, -2) @ R, [np.eye(3)] * 2, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(R), 1)
    assert np.all(np.sum(solved.normal * solved.position_m, -1) < 0)
    assert np.all(solved.position_m[:, 2] > 0)


@both
@given(ellipse=ellipses(max_ratio=0.9), scale=st.floats(0.1, 10))
def test_a_ring_twice_as_large_is_twice_as_far(solve, ellipse, scale):
    poses, scaled = solve(ellipse, CAMERA, NU), solve(ellipse, CAMERA, NU * scale)
    np.testing.assert_allclose(scaled.position_m, poses.position_m * scale, rtol=1e-9)
    np.testing.assert_allclose(scaled.rotation, poses.rotation, atol=1e-9)


@both
@given(T=visible_poses(min_tilt_deg=5), turn=st.floats(-np.pi, np.pi))
def test_turning_the_camera_about_its_axis_turns_the_poses(solve, T, turn):
    R = rotations.rotation_z(turn)
    e = conics.circle_ellipse(T, NU, CAMERA)
    centre = CAMERA.K[:2, 2]
    turned = Ellipse(R[:2, :2] @ (e.centre_px - centre) + centre, e.semi_axes_px, e.angle_rad + turn)
    before, after = solve(e, CAMERA, NU), solve(turned, CAMERA, NU)
    np.testing.assert_allclose(after.position_m, before.position_m @ R.T, atol=1e-9)
    np.testing.assert_allclose(after.normal, before.normal @ R.T, atol=1e-7)


@given(visible_poses(min_tilt_deg=20, max_tilt_deg=60))
def test_both_formulas_number_the_two_poses_alike(T):
    e = conics.circle_ellipse(T, NU, CAMERA)
    exact, paper = circle.poses(e, CAMERA, NU).normal, circle.paper_poses(e, CAMERA, NU).normal
    same, crossed = np.sum(exact * paper, -1), np.sum(exact * paper[::-1], -1)
    assert np.all(same > crossed)


@given(st.floats(0.3, 1.2))
def test_fronto_parallel_the_papers_normals_are_off_by_twice_the_rings_angle(distance):
    # the near and the true end of the minor axis make an isosceles triangle with the ring's centre
    T = pose((172.5, 129.5), distance, 0.0)
    solved = circle.paper_poses(conics.circle_ellipse(T, NU, CAMERA), CAMERA, NU)
    off_rad = rotations.angle_between_rad(solved.normal, T.normal)
    np.testing.assert_allclose(off_rad, 2 * np.arctan(NU / distance), rtol=1e-9)
    np.testing.assert_allclose(solved.position_m, [T.position_m] * 2, atol=1e-12)


@given(visible_poses())
def test_the_papers_position_is_close_to_the_truth(T):
    assert errors(circle.paper_poses, T)[1] < 0.15 * 1e3 * np.linalg.norm(T.position_m)


def test_ellipses_come_in_batches_of_any_shape():
    T = pose((150, 120), 0.6, 0.5)
    batch = Pose(np.broadcast_to(T.rotation, (2, 5, 3, 3)), np.broadcast_to(T.position_m, (2, 5, 3)))
    for solve in (circle.poses, circle.paper_poses):
        solved = solve(conics.circle_ellipse(batch, NU, CAMERA), CAMERA, NU)
        single = solve(conics.circle_ellipse(T, NU, CAMERA), CAMERA, NU)
        assert solved.position_m.shape == (2, 5, 2, 3)
        np.testing.assert_allclose(solved.rotation[1, 3], single.rotation, atol=1e-12)


@given(visible_poses(min_tilt_deg=3))
def test_pixels_need_not_be_square(T):
    camera = Camera(346, 260, 300.0, 330.0, 170.0, 131.0)
    normal, position = errors(circle.poses, T, camera)
    assert normal < 1e-7
    assert position < 1e-8


def test_a_line_of_sight_that_misses_the_sphere_gives_its_nearest_point():
    # a large ring near the border, strongly tilted: the discriminant is negative for one end
    T = pose((60, 60), 0.3, np.deg2rad(70), 3 * np.pi / 4)
    solved = circle.paper_poses(conics.circle_ellipse(T, NU, CAMERA), CAMERA, NU)
    assert np.all(np.isfinite(solved.rotation))


@both
@pytest.mark.parametrize("radius", [0.0, -1.0, float("nan")])
def test_a_radius_must_be_positive(solve, radius):
    with pytest.raises(ValueError, match="radius_m: expected"):
        solve(Ellipse([170, 130], [40, 30], 0.0), CAMERA, radius)


@both
@pytest.mark.parametrize(
    "ellipse", [Ellipse([np.nan, 1], [2, 1], 0), Ellipse([1, 1], [2, 0], 0), Ellipse([1, 1], [2, 1], np.nan)]
)
def test_an_ellipse_must_be_one(solve, ellipse):
    with pytest.raises(ValueError, match="ellipse"):
        solve(ellipse, CAMERA, NU)


@both
@pytest.mark.parametrize("centre", [(170, 130), (171.5, 90.25)])
@pytest.mark.parametrize("axes", [(50, 1e-3), (50, 1e-12), (1e-300, 1e-300), (1e7, 40), (1e200, 1e100)])
def test_needles_and_what_lies_far_outside_are_refused_quietly(solve, centre, axes):
    with pytest.raises(ValueError, match="view of a circle"):
        solve(Ellipse(centre, axes, 0.3), CAMERA, NU)
    with pytest.raises(ValueError, match="view of a circle"):
        solve(Ellipse([1e6, centre[1]], [50, 40], 0.3), CAMERA, NU)


@both
def test_strongly_tilted_circles_near_the_border_have_poses(solve):
    solved = solve(Ellipse([3000, 130], [50, 1], 0.0), CAMERA, NU)
    assert np.all(solved.position_m[:, 2] > 0) and np.all(np.isfinite(solved.rotation))


@both
def test_an_ellipse_around_the_principal_point_is_no_exception(solve):
    """All lines of sight around the optical axis, and a circle wider than it is far."""
    solved = solve(Ellipse([172.5, 129.5], [900.0, 700.0], 0.3), CAMERA, NU)
    assert np.all(np.isfinite(solved.rotation))
    assert np.all(np.isfinite(solved.position_m))


@both
def test_a_circle_behind_the_camera_or_through_it_has_no_ellipse_to_solve(solve):
    T = pose((150, 120), 0.6, 0.5)
    through = Pose(T.rotation, [0.0, 0.0, 0.02])
    e = conics.circle_ellipse(through, NU, CAMERA)  # a hyperbola: NaN by its docstring
    with pytest.raises(ValueError, match="ellipse"):
        solve(e, CAMERA, NU)


@given(visible_poses(max_tilt_deg=75))
@example(pose((172.5, 129.5), 0.6, np.deg2rad(0.01)))
@example(pose((172.5, 129.5), 1.2, np.deg2rad(0.1)))
@example(pose((100, 90), 0.3, np.deg2rad(0.02), 0.3))
def test_recovery_to_a_millionth_of_a_degree_and_of_a_millimetre(T):
    # nearer than 0.01 deg to head-on a double cannot hold the tilt so well: its ellipse is round to 1e-8
    assume(-T.normal @ T.position_m < np.cos(np.deg2rad(0.009)) * np.linalg.norm(T.position_m))
    normal, position = errors(circle.poses, T)
    assert normal < 1e-6
    assert position < 1e-6
