"""Laws of the odometry comparison: symmetry, scale and a perfect estimate leave no error."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from lmmap import odometry
from lmmap.core import Estimate, Port, Pose, Status, Trajectory
from lmmap.geometry import rotation_z
from lmmap.trajectories import write_estimates, write_trajectory

PORT = Port.lm_map()


def track(count=120, seed=0) -> Trajectory:
    """A smooth walk in front of the port, 10 poses a second."""
    rng, s = np.random.default_rng(seed), np.linspace(0, 1, count)[:, None]
    waves = np.sin(2 * np.pi * rng.uniform(0.5, 2, 6) * s + rng.uniform(0, 6, 6))
    turn = Rotation.from_rotvec(np.pi * np.array([1, 0, 0])) * Rotation.from_rotvec(0.3 * waves[:, :3])
    yaw = Rotation.from_rotvec(np.column_stack([0 * s, 0 * s, 4 * s]))
    return Trajectory(
        100_000 * np.arange(count), Pose((turn * yaw).as_matrix(), 0.1 * waves[:, 3:] + [0, 0, 0.6])
    )


def as_estimates(trajectory: Trajectory) -> list[Estimate]:
    poses = (trajectory.T_cam_port[k] for k in range(len(trajectory)))
    return [Estimate(t, Status.OK, T) for t, T in zip(trajectory.t_us.tolist(), poses, strict=True)]


def turned(trajectory: Trajectory, turns) -> Trajectory:
    T = trajectory.T_cam_port
    return Trajectory(
        trajectory.t_us, Pose(T.rotation @ rotation_z(PORT.yaw_period_rad * turns), T.position_m)
    )


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32))
def test_continuous_yaw_undoes_any_choice_of_markers(seed):
    original = track(seed=seed)
    turns = np.random.default_rng(seed).integers(0, 3, len(original))
    back = odometry.continuous_yaw(turned(original, turns), PORT.yaw_period_rad)
    expected = turned(original, np.full(len(original), turns[0]))
    np.testing.assert_allclose(back.T_cam_port.rotation, expected.T_cam_port.rotation, atol=1e-9)
    np.testing.assert_array_equal(back.T_cam_port.position_m, original.T_cam_port.position_m)


@pytest.mark.parametrize("count", [0, 1])
def test_continuous_yaw_of_almost_nothing(count):
    few = track(5)
    few = Trajectory(few.t_us[:count], few.T_cam_port[:count])
    assert len(odometry.continuous_yaw(few, PORT.yaw_period_rad)) == count


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32), st.floats(0.2, 5))
def test_scaled_and_ambiguous_truth_has_no_error(seed, scale):
    """Scale is aligned and yaw's multiple cancels: what is left of the camera's true path is nothing."""
    truth = track(seed=seed)
    T_port_cam = truth.T_cam_port.inverse
    scaled = Pose(T_port_cam.rotation, scale * T_port_cam.position_m).inverse
    turns = np.random.default_rng(seed).integers(0, 3, len(truth))
    table = odometry.errors(as_estimates(turned(Trajectory(truth.t_us, scaled), turns)), truth, PORT)
    assert len(table) and table.position_error_m.max() < 1e-9 and table.rotation_error_deg.max() < 1e-6


def test_noise_shows_as_much_as_it_is():
    """Independent errors of s in each coordinate at both ends: RMS s sqrt(6), at every length."""
    truth, sigma = track(400), 0.001
    rng = np.random.default_rng(0)
    T_port_cam = truth.T_cam_port.inverse
    noisy = Pose(T_port_cam.rotation, T_port_cam.position_m + rng.normal(0, sigma, (400, 3))).inverse
    table = odometry.errors(as_estimates(Trajectory(truth.t_us, noisy)), truth, PORT)
    rms = table.groupby("length_m").position_error_m.apply(lambda e: np.sqrt((e**2).mean()))
    assert len(rms) == len(odometry.FRACTIONS)
    np.testing.assert_allclose(rms, sigma * np.sqrt(6), rtol=0.2)


def test_too_few_poses_is_an_error():
    with pytest.raises(ValueError, match="at least"):
        odometry.errors([Estimate(0, Status.NO_RING)], track(), PORT)


def test_path_length_by_hand():
    """Along z by 1 m, then sideways by 2 m, never turning."""
    T = Pose(np.tile(np.eye(3), (3, 1, 1)), [[0, 0, 1.0], [0, 0, 2], [2, 0, 2]])
    assert odometry.path_length_m(Trajectory([0, 1, 2], T)) == pytest.approx(3.0)


def test_benchmark_counts_what_is_missing(tmp_path, monkeypatch):
    monkeypatch.setattr(odometry, "DERIVED", tmp_path)
    (tmp_path / "quick").mkdir()
    truth = track()
    for light in odometry.LIGHTS:
        write_trajectory(truth, tmp_path / "quick" / f"test-{light}.truth.csv")
        for modality in odometry.MODALITIES:
            found = as_estimates(truth) if (light, modality) != ("low", "event") else []
            write_estimates(found, tmp_path / "quick" / f"estimates-test-{light}-{modality}.csv")
    table = odometry.benchmark()
    assert (table.query("light == 'low' and modality == 'event'").outcome == "too few poses").all()
    assert table.query("outcome == 'tracked'").position_error_m.max() < 1e-9
    rows = odometry.summary(table)
    assert set(rows[rows.outcome == "not run yet"].method) == set(odometry.RIVALS)
    assert rows[rows.method == "lmmap"].stretches.sum() == table.position_error_m.notna().sum()
