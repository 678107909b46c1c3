"""Right, wrong and no answer: a table worked by hand, and shares that add up."""

import numpy as np
import pandas as pd
import pytest

from lmmap_lab.studies.right_and_wrong import by_limit, right_and_wrong


@pytest.fixture
def errors():
    """Right; wrong by position, by normal, by rotation; no pose; out of view."""
    none = np.nan
    return pd.DataFrame({
        "in_view": [True, True, True, True, True, False],
        "certain": [True, False, True, False, False, True],
        "position_error_m": [0.01, 0.03, 0.01, 0.01, none, 0.01],
        "normal_error_deg": [1.0, 1.0, 6.0, 1.0, none, 1.0],
        "rotation_error_deg": [2.0, 2.0, 2.0, 11.0, none, 2.0],
        "paper_position_error_m": [0.01, 0.01, 0.01, none, none, 0.01],
        "paper_normal_error_deg": [7.0, 4.0, 4.0, none, none, 4.0],
        "paper_rotation_error_deg": [7.0, 4.0, 4.0, none, none, 4.0],
    })  # fmt: skip


def test_shares_by_hand(errors):
    table = right_and_wrong([errors]).set_index("estimator")
    assert table.loc["ours", ["right_percent", "wrong_percent", "none_percent"]].tolist() == [20, 60, 20]
    assert table.loc["certain", ["right_percent", "wrong_percent", "none_percent"]].tolist() == [20, 20, 60]
    assert table.loc["printed", ["right_percent", "wrong_percent", "none_percent"]].tolist() == [40, 20, 40]
    assert (table.images == 5).all()


def test_shares_add_up_and_sequences_weigh_by_their_images(errors):
    once, twice = right_and_wrong([errors]), right_and_wrong([errors, errors])
    columns = ["right_percent", "wrong_percent", "none_percent"]
    np.testing.assert_allclose(twice[columns].sum(axis=1), 100)
    pd.testing.assert_frame_equal(once[columns], twice[columns])


def test_shares_by_limit_by_hand(errors):
    """Of five images in view two have a right pose, one a wrong one; the sixth image does not count."""
    right, confidence = [1, 1, 0, None, None, 1], [0.97, 0.6, 0.7, 0.0, 0.0, 0.9]
    confidences = pd.DataFrame({"t_us": range(6), "confidence": confidence, "right": right})
    rows = by_limit([errors.assign(t_us=range(6))], [confidences]).set_index("limit")
    assert rows.loc[0.0, ["right_percent", "wrong_percent", "none_percent"]].tolist() == [40, 20, 40]
    assert rows.loc[0.6, ["right_percent", "wrong_percent"]].tolist() == [40, 20]
    assert rows.loc[0.65, ["right_percent", "wrong_percent"]].tolist() == [20, 20]
    assert rows.loc[0.95, ["right_percent", "wrong_percent"]].tolist() == [20, 0]
    assert (rows.images == 5).all()
