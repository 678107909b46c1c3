"""The laboratory's commands lose nothing: inputs never change, and damaged files get short answers."""

import hashlib
import os
import subprocess
from functools import partial

import attack_recordings as attacks
import pytest
import torch
from attack_sound import CAMERA
from test_accuracy_run import made_up
from test_train import toy  # noqa: F401

from lmmap.types import InputError
from lmmap_lab.bench import photometry
from lmmap_lab.cli import bench
from lmmap_lab.provenance import DATA, ROOT
from lmmap_lab.studies import accuracy_run
from lmmap_lab.studies.bag_estimates import resumable_file
from lmmap_lab.training import train

MINI = DATA / "mini" / "test-low.aedat4"
NOTES = "notes that nobody has a copy of\nand a second line"


STUDIES = {
    "simulate": (
        "--sequence",
        "realistic-7",
        "--seconds",
        "0.2",
        "--camera",
        "{}/camera.json",
        "-o",
        "{}/s.h5",
    ),
    "photometry": ("-o", "{}/lamps.json"),
    "export": ("low", "-o", "{}/onnx"),
    "train": ("--filter", "ring", "--modality", "event", "--domain-gap", "low", "--steps", "1"),
    "reproduce": ("--profile", "quick"),
    "check": (),
    "completion": ("bash",),
    "adapt": (MINI, "--modality", "rgb", "--steps", "1", "-o", "{}/networks"),
}


@pytest.mark.parametrize("name", STUDIES)
def test_studies_change_no_file_that_they_were_not_told_to_write(name, tmp_path, monkeypatch, lmmap, request):
    """On toy training sets and made-up estimates: hashes of the whole project before and after."""
    CAMERA.save(tmp_path / "camera.json")
    monkeypatch.setattr(bench, "DERIVED_DATA", tmp_path)
    monkeypatch.setattr(photometry, "calibrate_lamps", lambda _: {"gain": 1.0})
    if name == "reproduce":
        study = partial(accuracy_run.reproduce, study=made_up(tmp_path))
        monkeypatch.setattr(accuracy_run, "reproduce", study)
    if name == "train":
        samples = request.getfixturevalue("toy").glob("augmented-*")
        (tmp_path / "training").mkdir()
        for folder in samples:
            folder.rename(tmp_path / "training" / folder.name)
        blank = torch.zeros(1, 1, 32, 32)
        monkeypatch.setattr(train, "make_batch", lambda *_: (blank, blank))
    files = subprocess.run(["git", "ls-files", "-z"], capture_output=True, cwd=ROOT, text=True).stdout
    files = [ROOT / name for name in files.split("\0") if name and (ROOT / name).is_file()]
    before, inputs = hashes(files), attacks.digests(tmp_path)
    code, _, err = lmmap(name, *(str(a).format(tmp_path) for a in STUDIES[name]))
    assert code == 0 or (name == "check" and len(err.splitlines()) == 1), err
    assert hashes(files) == before
    assert inputs.items() <= attacks.digests(tmp_path).items()


def hashes(files) -> list[str]:
    return [hashlib.sha256(path.read_bytes()).hexdigest() for path in files]


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
