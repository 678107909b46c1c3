"""The experiments on the paper port, on poses that are known."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lmmap.recordings.pose_files import read_truth
from lmmap.types import Estimate, Pose, Status
from lmmap_lab.pages import hold_it_page
from lmmap_lab.paper_port import experiments
from lmmap_lab.paper_port.experiments import COUNT, PARTS, SLIDE_MM
from lmmap_lab.provenance import DATA

TRUTH = read_truth(DATA / "mini" / "paper-port.truth.csv")


def estimates(move=lambda k, T: T):
    """The true poses of the clip, each moved."""
    poses = [move(k, TRUTH.poses[k]) for k in range(COUNT)]
    return [Estimate(k, Status.OK if T else Status.NO_RING, T) for k, T in enumerate(poses)]


@pytest.fixture(scope="module")
def truth():
    return TRUTH


def test_parts_follow_each_other_and_make_the_clip(port):
    edges = [(part.start, part.stop) for part in PARTS.values()]
    assert edges[0][0] == 0 and edges[-1][1] == COUNT == len(TRUTH)
    assert all(before[1] == after[0] for before, after in pairwise(edges))
    assert experiments.flat(port).plate_height_m == 0 < port.plate_height_m


def test_the_port_moves_as_the_parts_say():
    np.testing.assert_allclose(hold_it_page.slid_mm(estimates()), [SLIDE_MM, SLIDE_MM], atol=1e-3)
    for name, deg in (("head-on", 0), ("turned", 45)):
        T = TRUTH.poses[PARTS[name].start]
        assert np.degrees(np.arccos(min(-T.normal[2], 1.0))) == pytest.approx(deg, abs=1e-3)


def test_verdicts_count_each_image_once(port, truth):
    def move(k, T):
        if k % 3 == 0:
            return None
        return Pose(T.rotation, T.position_m + np.array([0, 0, 0.021 * (k % 3 - 1)]))

    counts = hold_it_page.count_verdicts(hold_it_page.verdicts(estimates(move), truth, port))
    assert list(counts.index) == list(PARTS) and counts.to_numpy().sum() == COUNT
    assert abs(counts.right.sum() - COUNT / 3) <= 1 and abs(counts.wrong.sum() - COUNT / 3) <= 1


def test_normals_are_off_by_what_they_were_turned(truth):
    def turn(k, T):
        return Pose(
            Rotation.from_rotvec([0, np.radians(0.1 * (k % 3)), 0]).as_matrix() @ T.rotation, T.position_m
        )

    assert hold_it_page.normal_error_deg(estimates(turn), truth, "slide") == pytest.approx(0.1, rel=1e-3)
