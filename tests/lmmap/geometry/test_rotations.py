"""Single rotations: a peer's answer, and an inverse."""

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.spatial.transform import Rotation
from strategies import seeds

from lmmap.geometry.rotations import single_rotation_matrix, single_rotation_vector


@settings(max_examples=50)
@given(seeds())
def test_matrices_and_vectors_are_the_peer_s(seed):
    rng = np.random.default_rng(seed)
    axis = rng.standard_normal(3)
    vector = axis / np.linalg.norm(axis) * 10 ** rng.uniform(-12, 0.49)  # up to just below half a turn
    R = single_rotation_matrix(vector)
    np.testing.assert_allclose(R, Rotation.from_rotvec(vector).as_matrix(), atol=1e-15)
    np.testing.assert_allclose(single_rotation_vector(R), vector, rtol=1e-6, atol=1e-15)


@pytest.mark.parametrize("angle_rad", [0.0, 1e-9, 0.99e-6, 1.01e-6, 0.99e-4, 1.01e-4])
def test_series_and_formula_meet(angle_rad):
    R = single_rotation_matrix([angle_rad, 0, 0])
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-15)
    assert single_rotation_vector(R)[0] == pytest.approx(angle_rad, rel=1e-9)
