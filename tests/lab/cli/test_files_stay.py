"""The laboratory's commands replace no file that is not theirs, and read none that never ends."""

import os

import pytest

from lmmap.types import InputError
from lmmap_lab.provenance import DATA
from lmmap_lab.rig import standin
from lmmap_lab.studies.bag_estimates import resumable_file
from lmmap_lab.unfinished import begin_folder

MINI = DATA / "mini" / "test-low.aedat4"
NOTES = "notes that nobody has a copy of\nand a second line"


def test_estimates_of_a_bag_replace_no_other_file(tmp_path):
    """``lmmap calibrate`` keeps them beside its output, under a name that somebody may have used."""
    path = tmp_path / "rig.normal__train-rgb.csv"
    path.write_text(NOTES)
    with pytest.raises(InputError, match="not ours to replace"):
        resumable_file(path, MINI, 5.0)
    assert path.read_text() == NOTES


def test_what_a_kill_leaves_of_finished_work_goes_with_the_next_run(tmp_path, monkeypatch):
    """Bags and marks that are whole are kept, and with them nothing of ours that lies beside them."""
    monkeypatch.setattr(standin, "STAND_INS", standin.STAND_INS[:2])
    bags = [tmp_path / name for name, _ in standin.STAND_INS]
    for bag in (tmp_path / standin.BOARD, *bags):
        bag.parent.mkdir(exist_ok=True)
        bag.touch()
    ours, theirs = (bag.with_suffix(".parts") for bag in bags)
    begin_folder(ours, "any")
    for name in (theirs, ours.with_name(f".{ours.stem}.lmmap.parts")):
        name.mkdir()
        (name / "notes").write_text(NOTES)
    ours.with_name(f".{ours.name}.writing").touch()
    standin.write_set(tmp_path, 1.0, report=lambda line: None)
    assert {p.name for p in ours.parent.iterdir()} >= {bags[0].name}
    left = [p for p in tmp_path.rglob("*") if "parts" in p.name]
    assert left == [theirs] and (theirs / "notes").read_text() == NOTES

    mark = resumable_file(tmp_path / "e.csv", MINI).with_suffix(".made-of")
    before, lock = mark.stat().st_mtime_ns, tmp_path / f".{mark.name}.writing"
    lock.touch()
    resumable_file(tmp_path / "e.csv", MINI)
    assert not lock.exists() and mark.stat().st_mtime_ns == before


@pytest.mark.parametrize("kind", ["pipe", "device"])
def test_trajectories_that_never_end_are_not_read(tmp_path, lmmap, kind):
    path, truth = tmp_path / f"{kind}.tum", MINI.with_suffix(".truth.csv")
    os.mkfifo(path) if kind == "pipe" else path.symlink_to("/dev/zero")
    for trajectory, reference in ((path, truth), (truth, path)):
        code, _, err = lmmap("odometry", "score", trajectory, "--reference", reference)
        assert code == 1 and len(err.splitlines()) == 1 and "a device or a pipe" in err, err
