"""The relative error equals that of evo with the options that match the definition."""

import numpy as np
import pytest
from evo.core import metrics as evo_metrics
from evo.core import sync
from evo.core.trajectory import PoseTrajectory3D
from scipy.spatial.transform import Rotation

from lmmap.types import Pose, Trajectory
from lmmap_lab.studies.trajectory_errors import relative_errors

LENGTHS_M = (0.1, 0.3, 1.0)


def walk(count, seed) -> Trajectory:
    """A smooth walk of a camera, 20 poses a second."""
    rng, s = np.random.default_rng(seed), np.linspace(0, 1, count)[:, None]
    waves = np.sin(2 * np.pi * rng.uniform(0.5, 3, 6) * s + rng.uniform(0, 6, 6))
    turn = Rotation.from_rotvec(0.8 * waves[:, :3]).as_matrix()
    return Trajectory(50_000 * np.arange(count), Pose(turn, 0.3 * waves[:, 3:]).inverse)


def disturbed(truth: Trajectory, seed) -> Trajectory:
    """Drifting, noisy, scaled, moved as a whole, at other times within 9 ms."""
    rng, T = np.random.default_rng(seed + 1), truth.poses.inverse
    small = Rotation.from_rotvec(rng.normal(0, 0.02, (len(truth), 3))).as_matrix()
    position = T.position_m + np.cumsum(rng.normal(0, 0.002, (len(truth), 3)), axis=0)
    world = Pose(Rotation.from_rotvec(rng.normal(size=3)).as_matrix(), rng.normal(size=3))
    moved = world @ Pose(T.rotation @ small, position * rng.uniform(0.2, 5))
    return Trajectory(truth.t_us + rng.integers(-9000, 9000, len(truth)), moved.inverse)


def without(trajectory: Trajectory, start, stop) -> Trajectory:
    kept = np.r_[0:start, stop : len(trajectory)]
    return Trajectory(trajectory.t_us[kept], trajectory.poses[kept])


def as_evo(trajectory: Trajectory) -> PoseTrajectory3D:
    T = trajectory.poses.inverse
    wxyz = np.roll(T.quaternion_xyzw, 1, axis=-1)
    return PoseTrajectory3D(T.position_m.copy(), wxyz, trajectory.t_us * 1e-6)


def evo_errors(estimate: Trajectory, reference: Trajectory, length_m: float, relation) -> np.ndarray:
    ref, est = sync.associate_trajectories(as_evo(reference), as_evo(estimate), max_diff=0.02)
    est.align(ref, correct_scale=True, n=40)
    metric = evo_metrics.RPE(relation, length_m, evo_metrics.Unit.meters, rel_delta_tol=0.2, all_pairs=True,
                             pairs_from_reference=True)  # fmt: skip
    metric.process_data((ref, est))
    return np.asarray(metric.error)


@pytest.mark.parametrize("gap", [None, (150, 152), (200, 260)])
@pytest.mark.parametrize("seed", range(3))
def test_relative_error_equals_evo(seed, gap):
    truth = walk(400, seed)
    estimate = disturbed(truth, seed)
    if gap:
        estimate = without(estimate, *gap)
    ours = relative_errors(estimate, truth, LENGTHS_M)
    for error in ours:
        relation = evo_metrics.PoseRelation
        translation = evo_errors(estimate, truth, error.length_m, relation.translation_part)
        rotation = evo_errors(estimate, truth, error.length_m, relation.rotation_angle_rad)
        assert len(translation) > 50
        np.testing.assert_allclose(error.translation_m, translation, atol=1e-9, rtol=0)
        np.testing.assert_allclose(error.rotation_rad, rotation, atol=1e-7, rtol=0)


def test_evo_s_default_is_another_metric():
    """A negative control: consecutive pairs, scale of all poses; the numbers must not agree."""
    truth = walk(400, 0)
    estimate = disturbed(truth, 0)
    ref, est = sync.associate_trajectories(as_evo(truth), as_evo(estimate), max_diff=0.02)
    est.align(ref, correct_scale=True)
    metric = evo_metrics.RPE(evo_metrics.PoseRelation.translation_part, 0.3, evo_metrics.Unit.meters)
    metric.process_data((ref, est))
    (ours,) = relative_errors(estimate, truth, [0.3])
    assert abs(np.median(metric.error) - np.median(ours.translation_m)) > 1e-4
