"""The quantile regression that says how far covariances are to be trusted."""

import numpy as np
import pandas as pd
import pytest
import refine_on_edges as refine
from scipy.stats import chi2


def test_of_one_column_it_is_the_quantile():
    y = np.random.default_rng(0).normal(size=401)
    fitted = refine.quantile_fit(np.ones((401, 1)), y, 0.9)
    assert fitted == pytest.approx(np.quantile(y, 0.9), abs=1e-6)


def test_the_share_below_is_the_one_asked_for():
    rng = np.random.default_rng(1)
    X = np.column_stack([np.ones(500), rng.normal(size=500)])
    y = X @ [0.5, -2.0] + rng.exponential(size=500) * (1 + (X[:, 1] > 0))
    below = np.sum(y < X @ refine.quantile_fit(X, y, 0.8) + 1e-9)
    assert 398 <= below <= 402


def test_distances_that_were_inflated_give_the_inflation_back():
    """Of covariances too small by 1.5 / score^0.8 it is 1.5 and 0.8, within their errors."""
    rng = np.random.default_rng(2)
    score = rng.uniform(0.3, 1.0, 1500)
    table = pd.DataFrame(
        {"score": score, "after distance": 1.5 / score**0.8 * chi2.rvs(6, size=1500, random_state=rng)}
    )
    inflation, fading = refine.inflation_of(table)
    assert inflation == pytest.approx(1.5, rel=0.1) and fading == pytest.approx(0.8, abs=0.2)
