"""A truth askew by one rotation is found on stand-ins; the errors of a formula are not taken for one."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from strategies import CAMERA, PORT

from lmmap.geometry.conics import circle_ellipse
from lmmap.types import Pose
from lmmap_lab.rig import standin
from lmmap_lab.studies import formula, misalignment

ASKEW_RAD = np.deg2rad([2.5, -3.5, 1.0])


def stand_in(name: str):
    """Poses and truths of forty seconds of a stand-in; the truth is of the arm."""
    estimates, arm = standin.simulate_detections(name, 40.0, np.random.default_rng(len(name)))
    rig = standin.RIG
    T = rig.T_cam_root @ arm.sample([e.t_us for e in estimates]).T_root_tip @ rig.T_tip_port
    return Pose(
        *(np.array([getattr(e.T_cam_port, f) for e in estimates]) for f in ("rotation", "position_m"))
    ), T


@pytest.fixture(scope="module")
def stand_ins():
    return {name: stand_in(name) for name in ("test-low", "realistic-1")}


def askew(recordings, frame):
    return {
        name: (poses, misalignment.without(truth, -ASKEW_RAD, frame))
        for name, (poses, truth) in recordings.items()
    }


@pytest.mark.parametrize("frame", misalignment.FRAMES)
def test_a_misalignment_put_in_is_found_in_its_frame_to_a_fifth_of_a_degree(stand_ins, frame):
    table = misalignment.misalignment(askew(stand_ins, frame), PORT.yaw_period_rad)
    found = table[table.frame == frame][["x_deg", "y_deg", "z_deg"]]
    np.testing.assert_allclose(found, np.rad2deg([ASKEW_RAD] * 2), atol=0.2)
    assert misalignment.verdict(table).startswith("misaligned truth: one rotation of 4.4")
    assert f"in the {frame}'s frame" in misalignment.verdict(table)


def literal(poses: Pose, truth: Pose) -> Pose:
    """The same poses with the normals of the printed formula."""
    n = formula.normals(
        circle_ellipse(truth, PORT.ring_radius_m, CAMERA), CAMERA, PORT.ring_radius_m, "printed"
    )
    n = n[np.arange(len(n)), np.sum(n * truth.normal[:, None], -1).argmax(1)]
    axis = np.cross(truth.normal, n)
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    turn = Rotation.from_rotvec(axis / sine * np.arctan2(sine, np.sum(n * truth.normal, 1, keepdims=True)))
    return Pose(turn.as_matrix() @ poses.rotation, poses.position_m)


def test_the_printed_formula_is_told_from_a_misaligned_truth(stand_ins):
    made = {name: (literal(*pair), pair[1]) for name, pair in stand_ins.items()}
    table = misalignment.misalignment(made, PORT.yaw_period_rad)
    assert table.normal_deg.min() > 4 and misalignment.verdict(table).startswith("no misaligned truth")


def test_an_aligned_truth_has_no_rotation_and_one_recording_is_halved(stand_ins):
    table = misalignment.misalignment({"one": stand_ins["test-low"]}, PORT.yaw_period_rad)
    assert list(table.recording[:2]) == ["one, first half", "one, second half"]
    assert table[["x_deg", "y_deg", "z_deg"]].abs().max().max() < 0.5
    assert misalignment.verdict(table).startswith("no misaligned truth")
    assert misalignment.verdict(misalignment.misalignment({}, PORT.yaw_period_rad)).startswith("too few")
