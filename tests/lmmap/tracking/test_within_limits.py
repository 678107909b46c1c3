"""The probability that a pose is right, against drawn errors."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2
from strategies import pose, seeds

from lmmap.settings import OURS
from lmmap.tracking.within_limits import is_certain, probability_within_limits
from lmmap.types import Estimate, Pose, Status

T = pose((200, 110), 0.6, 0.4, 0.7)


def drawn(rng) -> np.ndarray:
    """A covariance about as large as the limits, with correlations."""
    A = rng.standard_normal((6, 6)) * np.array([8e-3] * 3 + [0.04] * 3)[:, None]
    return A @ A.T / 6


def of(C) -> float:
    return probability_within_limits(Estimate(0, Status.OK, T, covariance=C))


def test_by_hand():
    """Sure to the last bit; and a position alone, as uncertain as its limit along each axis."""
    assert of(1e-12 * np.eye(6)) == pytest.approx(1)
    S = np.diag([OURS.right_position_m] * 3 + [1e-6] * 3)
    assert of(S**2) == pytest.approx(chi2.cdf(1, 3))


@given(seeds(), st.floats(1.01, 3))
def test_less_known_is_less_probable(seed, scale):
    rng = np.random.default_rng(seed)
    C = drawn(rng)
    assert of(scale * C) <= of(C) + 1e-12


@given(seeds())
@settings(max_examples=30)
def test_the_probability_within_limits_is_that_of_drawn_errors_and_not_overstated(seed):
    rng = np.random.default_rng(seed)
    C = drawn(rng)
    d = rng.multivariate_normal(np.zeros(6), C, 20_000)
    along = d[:, 3:] @ T.normal
    within = (np.linalg.norm(d[:, :3], axis=1) < OURS.right_position_m) & (
        np.linalg.norm(d[:, 3:] - np.outer(along, T.normal), axis=1) < OURS.right_normal_rad
    )
    within &= np.linalg.norm(d[:, 3:], axis=1) < OURS.right_rotation_rad
    promised = of(C)
    assert promised <= within.mean() + 0.03
    if promised > 0.8:
        assert promised >= within.mean() - 0.1


def test_certain_is_what_promises_to_be_right_in_95_of_100():
    """Standard deviations of position and normal at, and just over, the error that one may dock with."""
    head_on, promised = Pose(np.eye(3), np.ones(3)), []
    for position, turn in ((1, 1), (1.01, 0.1), (0.1, 1.01)):
        limits = [position * OURS.right_position_m] * 3 + [turn * OURS.right_normal_rad] * 2
        S = np.diag([*limits, 9.0]) / 1.9601  # yaw does not count
        promised.append(Estimate(0, Status.OK, head_on, covariance=S**2))
    assert is_certain([*promised, Estimate(0, Status.NO_RING)]).tolist() == [True, False, False, False]
