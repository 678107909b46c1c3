"""Rates of a track: counted by hand, and the waits after each loss."""

import numpy as np
import pandas as pd
import pytest

from lmmap_lab.studies.tracks import images_to_a_right_pose, rates


def table(answers: str) -> pd.DataFrame:
    """One letter an image: r(ight), w(rong), n(one), and capitals with the ring out of view."""
    error_m = {"r": 0.001, "w": 0.5, "n": np.nan}
    rows = [{"in_view": a.islower(), "position_error_m": error_m[a.lower()]} for a in answers]
    return pd.DataFrame(rows).assign(normal_error_deg=0.1, rotation_error_deg=0.1)


def test_shares_are_of_the_images_in_view():
    shares = rates([table("rrwnN"), table("RWrrr")])
    assert shares["images"] == 7 and shares["right_percent"] == pytest.approx(500 / 7)
    assert shares["wrong_percent"] == pytest.approx(100 / 7) == shares["none_percent"]


@pytest.mark.parametrize(
    "answers, waits",
    [
        ("rrrr", []),
        ("Nrr", [1]),
        ("rrNNnr", [2]),
        ("NnwrNrr", [3, 1]),
        ("NnnN", [np.inf]),
        ("NnNrr", [1]),  # a view of one image says nothing
    ],
)
def test_waits_are_counted_from_each_return(answers, waits):
    assert images_to_a_right_pose(table(answers)) == waits
    assert rates([table(answers)])["found_late"] == sum(w > 2 for w in waits)
