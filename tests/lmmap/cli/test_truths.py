"""What ``lmmap evaluate`` says of a truth before and after it estimates."""

import re

import drawn
import numpy as np
import pytest

from lmmap.pipeline.estimator import Estimator
from lmmap.recordings.pose_files import write_estimates, write_trajectory
from lmmap.types import Estimate, Pose, Status, Trajectory

DRAWN, R = drawn.file(6), drawn.recording(6)
RGB = "--modality", "rgb"


@pytest.fixture
def truth(tmp_path):
    """A truth as a file: every millisecond, or at other times; and other poses."""

    def write(t_us=None, change=lambda T: T, shift_us=0, name="t.csv"):
        t_us = np.arange(R.truth.t_us[0], R.truth.t_us[-1] + 1, 1000) if t_us is None else np.asarray(t_us)
        write_trajectory(Trajectory(t_us + shift_us, change(R.truth.at(t_us))), tmp_path / name)
        return tmp_path / name

    return write


@pytest.fixture
def perfect(monkeypatch):
    """An estimator that is right, 2 mm beside."""

    def answer(self, image, t_us=0, near=None):
        T = R.truth.at(t_us)
        return Estimate(t_us, Status.OK, Pose(T.rotation, T.position_m + 0.001))

    monkeypatch.setattr(Estimator, "__call__", answer)


@pytest.mark.parametrize("shift_us", [1_700_000_000_000_000, -3_600_000_000, 10_000_000])
def test_another_clock_is_found_before_anything_is_estimated(truth, lmmap, monkeypatch, shift_us):
    monkeypatch.setattr(Estimator, "__call__", None)
    path = truth(shift_us=shift_us)
    code, out, err = lmmap("evaluate", DRAWN, *RGB, "--truth", path)
    assert (code, out) == (1, "") and len(err.splitlines()) == 1
    assert re.search(
        rf"t\.csv: the truth's times are .* add {-shift_us * 1e-6:.6f} s to the truth's times", err
    )


def test_images_without_a_truth_are_counted(truth, lmmap, perfect):
    t_us = np.arange(0, 250_001, 1000)
    for keep, left in ((t_us <= 120_000, 3), ((t_us < 60_000) | (t_us > 190_000), 2), (t_us >= 0, 0)):
        code, out, err = lmmap("evaluate", DRAWN, *RGB, "--truth", truth(t_us[keep]))
        assert (code, err) == (0, "")
        assert re.search(rf"^images +{6 - left}\nimages without truth +{left}$", out, re.M)


@pytest.mark.parametrize("change, said", [
    (lambda T: Pose(T.rotation, 1000 * T.position_m), "taken as millimetres"),
    (lambda T: T.inverse, "inverted"),
    (lambda T: T, None),
])  # fmt: skip
def test_a_truth_in_another_form_is_named(truth, lmmap, perfect, change, said):
    code, _, err = lmmap("evaluate", DRAWN, *RGB, "--truth", truth(change=change))
    assert code == 0
    assert re.search(f"t\\.csv: .* off throughout; {said}, it is 1.73. mm", err) if said else err == ""


def test_estimates_as_a_truth_are_said(tmp_path, lmmap, perfect):
    write_estimates(
        [Estimate(t, Status.OK, R.truth.at(t)) for t in range(0, 250_001, 50_000)], tmp_path / "p.csv"
    )
    code, _, err = lmmap("evaluate", DRAWN, *RGB, "--truth", tmp_path / "p.csv")
    assert code == 0 and "p.csv: is a table of estimates" in err


def test_what_was_written_is_read_as_a_truth_whatever_its_name(tmp_path, lmmap, perfect):
    assert lmmap("estimate", DRAWN, *RGB, "-o", tmp_path / "a.txt")[0] == 0
    code, out, err = lmmap("evaluate", DRAWN, *RGB, "--truth", tmp_path / "a.txt")
    assert code == 0 and "a.txt: is a table of estimates" in err and re.search(r"^images +6$", out, re.M)
