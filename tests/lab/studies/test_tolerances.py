"""Wrong poses at other limits, by hand."""

import numpy as np
import pandas as pd
import pytest

from lmmap_lab.studies import tolerances


def errors(**columns):
    base = {"position_error_m": 0.0, "normal_error_deg": 0.0, "rotation_error_deg": 0.0, "in_view": True}
    return pd.DataFrame({**base, **columns})


def test_the_normal_alone_is_one_of_three_limits():
    """At our limits (20 mm, 5 and 10 deg) the first two are wrong, one of them by its normal."""
    table = errors(normal_error_deg=[6.0, 1, 1, np.nan], position_error_m=[0.001, 0.030, 0.001, np.nan])
    assert tolerances.wrong_percent(table, 1.0) == pytest.approx(50)
    assert tolerances.wrong_percent(table, 1.0, tolerances.NORMAL) == pytest.approx(25)
    assert tolerances.wrong_percent(table, 2.0) == 0  # 40 mm and 10 deg
    assert tolerances.wrong_percent(table, 0.02) == pytest.approx(75)  # a missing pose is never wrong


def test_images_out_of_view_do_not_count_and_wider_limits_never_add_wrong_poses():
    rng = np.random.default_rng(0)
    table = errors(normal_error_deg=rng.exponential(5, 200), position_error_m=rng.exponential(0.02, 200))
    table["in_view"] = np.arange(200) < 100
    measured = [table.assign(rung=name) for name in tolerances.MEASURED]
    found = tolerances.table([pd.concat(measured)], {name: [table] for name in tolerances.TRACKED})
    assert len(found) == 4 * 2 * len(tolerances.FACTORS) and found.rung.nunique() == 4
    for _, curve in found.groupby(["rung", "limits"]):
        assert (np.diff(curve.wrong_percent) <= 0).all()
    at_ours = found[(found.factor == 1) & (found.limits == tolerances.NORMAL)].wrong_percent
    assert at_ours.tolist() == pytest.approx([(table.normal_error_deg[:100] > 5).mean() * 100] * 4)
