"""The studies on a folder of bags, and training on it: from bags to the marked table, and going on."""

import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from attack_mutations import mutated
from test_authors_bags import brief, run

from lmmap.files import CAMERA
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.weights import weight_path
from lmmap.recordings.stream import Source, Stream
from lmmap.types import Camera, Port
from lmmap_lab import provenance
from lmmap_lab.rig import authors_bags, standin
from lmmap_lab.studies import on_authors_bags
from lmmap_lab.training import dataset, excerpts
from lmmap_readers.rig import RIG_FILE


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """0.3 s of each kind of bag, one that is no bag, and results elsewhere than the checkout's."""
    root, recording = tmp_path / "tiny", brief(0.3)
    for name in ("dark__test", "light__hard", "mixed__test", "T1_RA_0_ES_0_noport", "normal__train"):
        path = root / "dataset_0307_notexture" / f"{name}.bag"
        path.parent.mkdir(parents=True, exist_ok=True)
        standin.write_bag(replace(recording, truth=None) if "noport" in name else recording, path)
    (root / "holiday.bag").write_bytes(b"none")
    standin.write_hand_eye(root / authors_bags.HAND_EYE)
    standin.RIG.save(root / RIG_FILE)
    Camera.davis346().save(root / CAMERA)
    for module in (provenance, on_authors_bags):
        monkeypatch.setattr(module, "DERIVED_DATA", tmp_path / "derived")
    return root


def test_reproduce_ends_with_the_marked_table(folder, capsys, monkeypatch):
    monkeypatch.setattr(on_authors_bags.table1, "DOMAIN_GAPS", ("low",))
    code, out, err = run(capsys, "reproduce", "--data", folder)
    assert code == 0, err
    assert "left out: holiday.bag: cannot read this bag" in out
    assert "\ntoo few poses to tell a misaligned truth\n" in out
    for title in ("hard cases", "false detections", "lights that are not the paper's"):
        assert f"{title} (recordings: tiny)" in out
    table = out.split("table (recordings: tiny")[1]
    assert "paper" in table and "low-domain-gap" in table and out.endswith(table)
    made = on_authors_bags.output(folder)
    summary = pd.read_csv(made / "summary.csv").set_index(["light", "modality", "metric"])
    error_m = summary.query(
        "statistic == 'median' and variant == 'exact' and outlier_filter == 'without'"
    ).value
    assert 0 < error_m["low", "rgb", "position_error_m"] < 0.01
    assert error_m["low", "rgb", "position_error_m"] == error_m["mixed", "rgb", "position_error_m"]
    assert len(pd.read_csv(made / "false.csv")) == 2
    monkeypatch.setattr(Estimator, "__call__", None)  # a second run estimates nothing anew
    code, again, _ = run(capsys, "reproduce", "--data", folder)
    assert code == 0 and again == out
    next(folder.rglob("light__hard.bag")).unlink()  # what came of it goes with it
    assert "hard cases" not in run(capsys, "reproduce", "--data", folder)[1]


def test_networks_learn_from_the_training_bag_and_stand_beside_the_default_ones(folder, capsys, monkeypatch):
    monkeypatch.setattr(on_authors_bags.table1, "DOMAIN_GAPS", ("low",))
    (next(folder.rglob("mixed__test.bag"))).unlink()
    code, out, err = run(capsys, "reproduce", "--data", folder, "--adapt")
    assert code == 0 and "learned: from normal__train.bag\n" in out, err
    assert out.count("networks as before") == 2  # so little teaches nothing
    assert "networks that learned the laboratory by themselves (recordings: tiny)" in out
    summary = pd.read_csv(on_authors_bags.output(folder) / "summary.csv").set_index("training")
    default, learned = (summary.loc[name].value.to_numpy() for name in on_authors_bags.BY_ITSELF)
    assert np.array_equal(default, learned, equal_nan=True) and np.isfinite(default).any()
    next(folder.rglob("normal__train.bag")).unlink()  # the only one: a bag that is tested on teaches
    assert (
        "learned: from dark__test.bag, which is tested on"
        in run(capsys, "reproduce", "--data", folder, "--adapt")[1]
    )
    code, _, err = run(capsys, "reproduce", "--adapt")
    assert code == 1 and "give --data FOLDER" in err and err.count("\n") == 1


def test_nothing_to_test_on_is_one_line(folder, capsys):
    for path in folder.rglob("*.bag"):
        path.write_bytes(b"none")
    code, _, err = run(capsys, "reproduce", "--data", folder)
    assert code == 1 and "no bag for testing is usable" in err and err.count("\n") == 1


@pytest.mark.parametrize("command", ["reproduce", "train"])
@pytest.mark.parametrize("seed", range(2))
def test_damaged_bags_make_no_noise(folder, capfd, monkeypatch, command, seed):
    """The second is the only bag of its kind: at most a note and an error, nothing of the libraries'."""
    monkeypatch.setattr(on_authors_bags.table1, "DOMAIN_GAPS", ("low",))
    rng, bags = np.random.default_rng(seed), folder / "dataset_0307_notexture"
    for name in ("light__hard", "mixed__test"):
        (bags / f"{name}.bag").unlink()
    for path in sorted(bags.glob("*.bag")):
        path.write_bytes(mutated(path.read_bytes(), rng, text=False)[1])
    steps = ("--steps", "1", "--filter", "ring", "--modality", "rgb") if command == "train" else ()
    code, _, err = run(capfd, command, "--data", folder, *steps)
    assert code in (0, 1) and len(err.splitlines()) <= 2 and "Traceback" not in err, err


def test_training_on_bags_makes_filters_that_reproduce_takes(folder, capsys, monkeypatch):
    monkeypatch.setattr(excerpts, "SEQUENCE_SECONDS", 0.055)
    monkeypatch.setattr(excerpts, "EXCERPT_EVERY_S", 0.055)
    argv = ("train", "--data", folder, "--modality", "rgb", "--networks", "low", "--steps", "1",
            "--filter", "ring", "--start-from", "low")  # fmt: skip
    code, out, err = run(capsys, *argv)
    assert code == 0, err
    made = on_authors_bags.output(folder)
    assert out.count("written") == 1 and (made / "weights-low" / "ring-rgb-low.json").exists()
    assert on_authors_bags.weights_of(made, "rgb", "low") == "low"  # until there are both filters
    shutil.copy(weight_path("reflector", "rgb", "low"), made / "weights-low")
    assert on_authors_bags.weights_of(made, "rgb", "low") == made / "weights-low"
    names = [f"dataset_0307_notexture--normal__train-{k:04d}" for k in range(5)]
    samples = dataset.Samples(names, "ring", "rgb", made / "training")
    assert len(samples) >= 5 and samples.made_of() == "recordings"
    code, _, err = run(capsys, "train", "--data", folder, "--networks", "high")
    assert code == 1 and "no usable training bag for the high domain gap" in err


@pytest.mark.parametrize("starts_us", [[0, 200_000], [30_000, 130_000, 380_000], [450_000]])
def test_excerpts_are_cuts_of_the_recording(starts_us):
    whole = brief(0.5)
    pieces = [whole.events[k : k + 9000] for k in range(0, len(whole.events), 9000)]
    source = Source(None, events=lambda: iter(pieces), frames=whole.timed_frames)
    stream = Stream("cut", whole.camera, source, whole.truth)
    for start_us, piece in zip(starts_us, excerpts.excerpts(stream, starts_us, 100_000), strict=True):
        t_us, frames_t_us = whole.events["t_us"], whole.frames_t_us
        inside = (t_us >= start_us) & (t_us < start_us + 100_000)
        shown = (frames_t_us >= start_us) & (frames_t_us < start_us + 100_000)
        assert np.array_equal(piece.events, whole.events[inside]) and inside.any()
        assert np.array_equal(piece.frames, whole.frames[shown])
    masks = dataset.sample_recording(piece, 2, Port.lm_map())
    assert set(np.unique(masks["rgb_labels"])) == {0, 1, 2}  # ring and markers
