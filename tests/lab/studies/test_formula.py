"""The paper's formula, read in four ways: its limits in closed form, and agreement with the estimator's."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from strategies import CAMERA, PORT

from lmmap.geometry.conics import circle_ellipse
from lmmap.types import Pose
from lmmap_lab.studies import formula

NU, Z = PORT.ring_radius_m, 0.6


def on_axis(tilt_deg, azimuth_rad=0.0) -> Pose:
    axis = [np.cos(azimuth_rad), np.sin(azimuth_rad), 0]
    turn = Rotation.from_rotvec(np.deg2rad(tilt_deg) * np.array(axis)) * Rotation.from_rotvec([np.pi, 0, 0])
    return Pose(turn.as_matrix()[None], [[0, 0, Z]])


@pytest.fixture(scope="module")
def poses():
    return formula.bench_poses(CAMERA, PORT, trajectories=1, rate_hz=1.0)


def test_head_on_the_printed_normal_is_off_by_twice_the_ring_s_half_angle():
    bias = formula.errors_rad(on_axis(0), CAMERA, NU, "printed")
    np.testing.assert_allclose(bias, 2 * np.arctan(NU / Z), rtol=1e-6)


@pytest.mark.parametrize("tilt_deg", [10, 25, 45, 65])
@pytest.mark.parametrize("azimuth_rad", [0.0, 0.8, 2.5])
def test_with_the_true_centre_the_nearer_root_is_exact_on_the_axis(tilt_deg, azimuth_rad):
    T = on_axis(tilt_deg, azimuth_rad)
    assert formula.errors_rad(T, CAMERA, NU, "true centre")[0] < 1e-6
    assert formula.errors_rad(T, CAMERA, NU, "printed")[0] > np.deg2rad(3)


@pytest.mark.parametrize("tilt_deg", [0, 5, 30, 60])
def test_the_ellipse_s_centre_is_not_the_circle_s(tilt_deg):
    seen = circle_ellipse(on_axis(tilt_deg), NU, CAMERA)
    offset_px = np.linalg.norm(seen.centre_px - [CAMERA.cx_px, CAMERA.cy_px])
    expected = formula.centre_offset_rad(Z, np.deg2rad(tilt_deg), NU)
    assert np.arctan(offset_px / CAMERA.fx_px) == pytest.approx(expected, abs=1e-9)


def test_readings_by_tilt_and_by_lens(poses):
    table = formula.medians_by_tilt(poses, CAMERA, NU)
    assert (table.loc["all", "printed"] > 3 * table.loc["all", ["ends", "true centre"]]).all()
    sweep = formula.lens_sweep(poses, CAMERA, NU, [4e-3, 6e-3, 12e-3])
    assert (sweep.diff().dropna() < 0).all().all()
    assert sweep.loc[6.0, "printed"] == pytest.approx(table.loc["all", "printed"], rel=1e-2)
    assert formula.lens_for(sweep.loc[6.0, "printed"], sweep) == pytest.approx(6.0)
    assert 6 < formula.lens_for(0.8 * sweep.loc[6.0, "printed"], sweep) < 12


def test_an_unknown_reading_is_named():
    with pytest.raises(ValueError, match="printed, ends, four, true centre, got 'fifth'"):
        formula.normals(circle_ellipse(on_axis(20), NU, CAMERA), CAMERA, NU, "fifth")
