import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import CAMERA, PORT, pose

from lmmap.geometry import conics
from lmmap_lab.studies import sensitivity

F, NU = CAMERA.fx_px, PORT.ring_radius_m


@given(st.floats(0.2, 2), st.floats(0, 1.5))
def test_the_minor_axis_is_that_of_the_projected_circle(distance, tilt):
    ellipse = conics.circle_ellipse(pose((172.5, 129.5), distance, tilt), NU, CAMERA)
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


@given(st.floats(0.4, 1.2), st.floats(0, 1.0))
def test_bisection_finds_the_closed_form(distance, tilt):
    turn = sensitivity.turn_rad("full minor axis", distance, tilt, F, NU)
    assert turn == pytest.approx(sensitivity.explained_rotation_rad(distance, tilt, F, NU), rel=1e-3)


@pytest.mark.parametrize("reading", sensitivity.READINGS)
def test_every_reading_is_worth_less_with_a_longer_lens(reading):
    turns = [sensitivity.turn_rad(reading, 0.6, np.deg2rad([10, 45]), f, NU) for f in (324, 486, 648)]
    assert np.all(np.diff(turns, axis=0) < 0)


def test_only_the_full_minor_axis_gives_both_numbers_with_a_ring_that_fits_the_view():
    consistent = []
    for reading in sensitivity.READINGS:
        ring_m = sensitivity.ring_for(reading, np.deg2rad(8.9), 0.6, F)
        if np.isnan(ring_m):
            continue
        inclined_deg = np.rad2deg(sensitivity.turn_rad(reading, 0.6, np.deg2rad(45), F, ring_m))
        in_view_at_half_a_metre = 2 * F * ring_m / 0.5 < CAMERA.height_px
        if in_view_at_half_a_metre and abs(inclined_deg - 1) < 0.15:
            consistent.append(reading)
    semi = 2 * F * sensitivity.ring_for("semi-minor axis", np.deg2rad(8.9), 0.6, F) / 0.6
    assert consistent == ["full minor axis"]
    assert 190 < semi < 230


def test_refitting_the_position_leaves_less_to_see():
    before, after = sensitivity.tilted_pose(0.6, 0.3), sensitivity.tilted_pose(0.6, 0.4)
    held = sensitivity.displacements(before, after, NU)
    free = sensitivity.displacements(before, sensitivity.refit_pose(before, after, NU), NU)
    assert np.sum(free**2) < 0.8 * np.sum(held**2)


@given(st.floats(0.4, 1.0), st.floats(0.3, 1.1), st.integers(50, 400))
def test_the_bound_falls_with_the_root_of_the_points_and_rises_with_the_noise(distance, tilt, count):
    T = sensitivity.tilted_pose(distance, tilt)
    normal, position = sensitivity.cramer_rao(T, NU, CAMERA, count, 0.05)
    more = sensitivity.cramer_rao(T, NU, CAMERA, 4 * count, 0.05)
    noisier = sensitivity.cramer_rao(T, NU, CAMERA, count, 0.1)
    np.testing.assert_allclose(more, [normal / 2, position / 2], rtol=0.02)
    np.testing.assert_allclose(noisier, [2 * normal, 2 * position], rtol=0.02)


def test_an_unknown_reading_is_named():
    with pytest.raises(ValueError, match="reading: expected"):
        sensitivity.turn_rad("diagonal", 0.6, 0.0, F, NU)
    with pytest.raises(ValueError, match="distance_m: expected"):
        sensitivity.turn_rad("full minor axis", 0.05, 0.0, F, NU)


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


def test_the_normal_reaches_the_bound_and_the_region_holds_its_share():
    table = sensitivity.monte_carlo([0, 5, 12, 20, 45], 600, CAMERA, NU, np.random.default_rng(0))
    assert np.all(table.rms_over_bound[table.tilt_deg >= 12] <= 1.06)
    assert table.inside_95_percent.between(92, 97).all()
    assert table.mean_nees.between(4.6, 5.4).all()
