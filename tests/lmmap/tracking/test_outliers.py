import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import PORT

from lmmap.geometry.rotations import rotation_z
from lmmap.tracking.outliers import outlier_filter
from lmmap.types import Estimate, Pose, Status

PERIOD = PORT.yaw_period_rad


def estimates(yaws_deg):
    """One estimate per yaw; None is a frame without a pose."""
    return [
        Estimate(k, Status.NO_RING) if yaw is None
        else Estimate(k, Status.OK, Pose(rotation_z(np.deg2rad(yaw)), [0, 0, 1]))
        for k, yaw in enumerate(yaws_deg)
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("yaws_deg", "kept"),
    [
        ([0, 5, 10, 15, 20], [0, 0, 1, 1, 1]),
        ([0, 0, 14.9, 0, 0], [0, 0, 1, 1, 1]),
        ([0, 0, 15.1, 0, 0], [0, 0, 0, 0, 0]),
        ([0, 0, 0, 40, 40, 40, 40], [0, 0, 1, 0, 0, 1, 1]),
        ([0, 0, None, 0, 0, 0], [0, 0, 0, 0, 0, 1]),
        ([0, 120, 245, 0], [0, 0, 1, 1]),  # thirds of a turn are the same orientation
        ([None, None, None], [0, 0, 0]),
        ([0, 0], [0, 0]),
        ([0], [0]),
        ([], []),
    ],
)
def test_three_in_a_row_within_15_degrees(yaws_deg, kept):
    keep = outlier_filter(estimates(yaws_deg), PERIOD)
    assert keep.dtype == bool
    assert keep.tolist() == [bool(k) for k in kept]


YAWS = st.integers(0, 972).map(lambda k: 0.37 * k)  # no two of which are 15 deg apart to the last bit


@given(st.lists(st.one_of(st.none(), YAWS), max_size=30))
def test_the_filter_is_the_papers_sentence(yaws_deg):
    sequence = estimates(yaws_deg)

    def close(a, b):
        difference = abs(a - b) % 120
        return min(difference, 120 - difference) <= 15

    for k, kept in enumerate(outlier_filter(sequence, PERIOD)):
        last = yaws_deg[max(k - 2, 0) : k + 1]
        whole = len(last) == 3 and None not in last
        assert kept == (whole and close(last[0], last[1]) and close(last[1], last[2]))
