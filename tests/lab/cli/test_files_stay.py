"""The laboratory's commands replace no file that is not theirs, and read none that never ends."""

import os

import pytest

from lmmap.types import InputError
from lmmap_lab.provenance import DATA
from lmmap_lab.studies.bag_estimates import resumable_file

MINI = DATA / "mini" / "test-low.aedat4"
NOTES = "notes that nobody has a copy of\nand a second line"


def test_estimates_of_a_bag_replace_no_other_file(tmp_path):
    """``lmmap calibrate`` keeps them beside its output, under a name that somebody may have used."""
    path = tmp_path / "rig.normal__train-rgb.csv"
    path.write_text(NOTES)
    with pytest.raises(InputError, match="not ours to replace"):
        resumable_file(path, MINI, 5.0)
    assert path.read_text() == NOTES


@pytest.mark.parametrize("kind", ["pipe", "device"])
def test_trajectories_that_never_end_are_not_read(tmp_path, lmmap, kind):
    path, truth = tmp_path / f"{kind}.tum", MINI.with_suffix(".truth.csv")
    os.mkfifo(path) if kind == "pipe" else path.symlink_to("/dev/zero")
    for trajectory, reference in ((path, truth), (truth, path)):
        code, _, err = lmmap("odometry", "score", trajectory, "--reference", reference)
        assert code == 1 and len(err.splitlines()) == 1 and "a device or a pipe" in err, err
