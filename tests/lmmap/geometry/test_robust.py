"""Medians and Tukey's weights."""

import numpy as np
import pytest

from lmmap.geometry.robust import TUKEY, median, tukey_cut, tukey_weights

RESIDUALS = np.random.default_rng(0).normal(0, 0.3, 1001)


@pytest.mark.parametrize("count", [1, 2, 7, 400, 1001])
def test_the_median_is_numpys(count):
    assert median(RESIDUALS[:count]) == pytest.approx(np.median(RESIDUALS[:count]), abs=1e-15)


def test_the_cut_is_of_the_residuals_deviation_and_a_third_of_outliers_hardly_moves_it():
    cut = tukey_cut(RESIDUALS)
    assert cut == pytest.approx(TUKEY * 0.3, rel=0.05)
    assert tukey_cut(np.append(RESIDUALS, np.full(500, 1e6))) < 2 * cut
    assert tukey_cut(np.zeros(9), least_sigma=0.1) == pytest.approx(TUKEY * 0.1)


def test_weights_fall_from_one_to_nothing_at_the_cut():
    weights = tukey_weights(np.array([0, 0.5, -0.5, 0.999, 1, 7]), 1.0)
    np.testing.assert_allclose(weights, [1, 0.5625, 0.5625, 0, 0, 0], atol=1e-5)
