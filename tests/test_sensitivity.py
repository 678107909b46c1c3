import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import CAMERA, PORT, pose

from lmmap import geometry, sensitivity

F, NU = CAMERA.fx_px, PORT.ring_radius_m


@given(st.floats(0.2, 2), st.floats(0, 1.5))
def test_the_minor_axis_is_that_of_the_projected_circle(distance, tilt):
    ellipse = geometry.circle_ellipse(pose((172.5, 129.5), distance, tilt), NU, CAMERA)
    expected = 2 * ellipse.semi_axes_px[1]
    assert sensitivity.minor_axis_px(distance, tilt, F, NU) == pytest.approx(expected, rel=1e-6)


@given(st.floats(0.2, 2), st.floats(0.01, 1.5))
def test_tilt_and_minor_axis_are_each_others_inverse(distance, tilt):
    minor = sensitivity.minor_axis_px(distance, tilt, F, NU)
    assert sensitivity.tilt_from_minor_axis_rad(distance, minor, F, NU) == pytest.approx(tilt, abs=1e-9)


def test_the_papers_two_numbers():
    turn = np.rad2deg(sensitivity.explained_rotation_rad(0.6, np.deg2rad([0, 45]), F, NU))
    assert turn[0] == pytest.approx(8.9, abs=0.05)
    assert turn[1] == pytest.approx(1.0, abs=0.1)


@given(st.floats(0.3, 1.0), st.floats(0, 1.2), st.floats(0.1, 3))
def test_the_turn_shortens_the_minor_axis_by_that_many_pixels(distance, tilt, pixels):
    turn = sensitivity.explained_rotation_rad(distance, tilt, F, NU, pixels)
    before, after = sensitivity.minor_axis_px(distance, np.array([tilt, tilt + turn]), F, NU)
    assert before - after == pytest.approx(pixels, abs=1e-7)


def test_it_grows_with_distance_and_falls_with_tilt():
    distance, tilt = np.meshgrid(np.linspace(0.3, 1.2, 20), np.deg2rad(np.linspace(0, 60, 20)), indexing="ij")
    turn = sensitivity.explained_rotation_rad(distance, tilt, F, NU)
    assert np.all(np.diff(turn, axis=0) > 0)
    assert np.all(np.diff(turn, axis=1) < 0)


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        ((0.05, 0.1, F, NU), "distance_m"),
        ((0.6, -0.1, F, NU), "tilt_rad"),
        ((0.6, np.pi / 2, F, NU), "tilt_rad"),
        ((0.6, 1.57, F, NU), "pixels"),
        ((0.6, 0.1, F, NU, -1), "pixels"),
        ((0.6, 0.1, F, -1), "distance_m"),
    ],
)
def test_impossible_cases_are_refused(arguments, name):
    with pytest.raises(ValueError, match=f"{name}: expected"):
        sensitivity.explained_rotation_rad(*arguments)
