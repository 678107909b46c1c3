"""A truth in another form than it is read in is named, if its poses tell; a wrong or a sound one is not."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from strategies import facing_pose

from lmmap.recordings.pose_files import read_truth, write_trajectory
from lmmap.types import Estimate, Pose, Status, Trajectory
from lmmap_readers import truth_form

THIRD = 2 * np.pi / 3


def motion(seed) -> Trajectory:
    rng = np.random.default_rng(seed)
    turn, shift = 0.3 * rng.standard_normal(3), 0.1 * rng.standard_normal(3)
    start = facing_pose(*rng.uniform(-0.4, 0.4, 3), [0.02, -0.03, 0.7])
    s = np.linspace(0, 1, 40)
    rotation = Rotation.from_rotvec(s[:, None] * turn).as_matrix() @ start.rotation
    return Trajectory(25_000 * np.arange(40), Pose(rotation, start.position_m + s[:, None] * shift))


def estimates(truth: Trajectory, off_m=0.002) -> list[Estimate]:
    T = truth.at(np.arange(10_000, 900_000, 50_000))
    poses = [Pose(R, p + off_m) for R, p in zip(T.rotation, T.position_m, strict=True)]
    return [Estimate(10_000 + 50_000 * k, Status.OK, pose) for k, pose in enumerate(poses)]


def written(path, truth: Trajectory, form: str, w_first=False, scale=1.0, inverse=False) -> Trajectory:
    """The truth as a file of another form is read."""
    T = Trajectory(truth.t_us, truth.poses.inverse) if inverse else truth
    write_trajectory(T, path, form)
    sign = "," if form == "csv" else " "
    head, rows = (1, path.read_text().splitlines()) if form == "csv" else (0, path.read_text().splitlines())
    for k, row in enumerate(rows[head:], head):
        t, *xyz, qx, qy, qz, qw = row.split(sign)
        q = (qw, qx, qy, qz) if w_first else (qx, qy, qz, qw)
        rows[k] = sign.join([t, *(f"{float(v) * scale:.9g}" for v in xyz), *q])
    path.write_text("\n".join(rows) + "\n")
    return read_truth(path)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("form", ["csv", "tum"])
@pytest.mark.parametrize(
    "change, said",
    [
        ({"w_first": True}, "w first"),
        ({"scale": 1000.0}, "millimetres"),
        ({"inverse": True}, "inverted"),
        ({"w_first": True, "scale": 1000.0}, "w first.*millimetres"),
        ({"inverse": True, "w_first": True}, "inverted.*w first"),
    ],
)
def test_a_form_is_named(tmp_path, seed, form, change, said):
    truth = motion(seed)
    read = written(tmp_path / f"t.{form}", truth, form, **change)
    assert truth_form.other(estimates(truth), truth, THIRD) is None
    words = truth_form.other(estimates(truth), read, THIRD)
    assert re.search(f"off throughout; .*{said}.*, it is", words)


def test_what_no_form_explains_is_not_named():
    truth = motion(0)
    assert truth_form.other(estimates(truth, off_m=0.3), truth, THIRD) is None
    assert truth_form.other(estimates(truth)[:4], motion(1), THIRD) is None
    assert truth_form.other([], truth, THIRD) is None
