"""Shared pieces of the tests: a camera, a port, poses over the whole working range."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from lmmap.types import Camera, Port, Pose
from lmmap_lab.provenance import DATA

settings.register_profile("lmmap", deadline=None, max_examples=60, derandomize=True)
settings.load_profile("lmmap")


@pytest.fixture
def camera():
    return Camera.davis346()


@pytest.fixture
def port():
    return Port.lm_map()


@pytest.fixture
def rng():
    return np.random.default_rng(20)


def facing_pose(tilt_rad, azimuth_rad, yaw_rad, position_m) -> Pose:
    """A port that looks at the camera, tilted about an axis in the image plane, then turned."""
    tilt = Rotation.from_rotvec(tilt_rad * np.array([np.cos(azimuth_rad), np.sin(azimuth_rad), 0]))
    turn = tilt * Rotation.from_rotvec([np.pi, 0, 0]) * Rotation.from_rotvec([0, 0, yaw_rad])
    return Pose(turn.as_matrix(), position_m)


@st.composite
def facing_poses(draw):
    """Poses in view; fronto-parallel on the axis is always among the first drawn."""
    tilt = draw(st.one_of(st.just(0.0), st.floats(0, 1.2)))
    angle = st.floats(-np.pi, np.pi)
    depth = draw(st.floats(0.35, 1.2))
    x, y = draw(st.floats(-0.2, 0.2)), draw(st.floats(-0.15, 0.15))
    return facing_pose(tilt, draw(angle), draw(angle), [x * depth, y * depth, depth])


@pytest.fixture
def compared():
    """One quarter of the paper's table, ours twice as large with intervals, and no *certain*."""
    table = pd.read_csv(DATA / "paper" / "table1.csv").rename(columns={"value": "table1"})
    table = table.query("training == 'low-domain-gap' and outlier_filter == 'without'")
    return table.assign(ours=2 * table.table1, ours_low=table.table1, ours_high=3 * table.table1,
                        printed=table.table1, printed_low=table.table1, printed_high=table.table1,
                        fused=np.nan)  # fmt: skip
