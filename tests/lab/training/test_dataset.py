"""Samples on disk: every N-event histogram from one file, masks with their images, whole or not at all."""

import os

import numpy as np
import pytest

from lmmap.pipeline.histograms import histogram
from lmmap.pipeline.weights import SETS, WEIGHTS, load_card
from lmmap.recordings.formats import open_recording
from lmmap.settings import PAPER
from lmmap.types import InputError
from lmmap_lab.bench import labels, laboratory, varied
from lmmap_lab.provenance import DATA
from lmmap_lab.training import dataset


@pytest.fixture(scope="module")
def recording():
    return open_recording(DATA / "mini" / "test-low.aedat4")


@pytest.fixture(scope="module")
def folder(recording, tmp_path_factory):
    folder = tmp_path_factory.mktemp("set")
    dataset.write_samples(folder / "mini", dataset.sample_recording(recording, 3))
    return folder


@pytest.mark.parametrize("gap", SETS)
def test_split_is_by_sequence_and_complete(gap):
    names = dataset.SETS[gap]
    train, validate = dataset.split(names)
    assert not set(train) & set(validate)
    assert sorted(train + validate) == sorted(names)
    assert len(validate) == pytest.approx(0.2 * len(names), abs=1)
    assert {n.split("-")[0] for n in validate} == {n.split("-")[0] for n in names}
    drawn = [n for n in names if not varied.NAME.fullmatch(n)]
    assert [laboratory.sequence(n).name for n in drawn] == drawn


def test_only_the_high_gap_lacks_the_realistic_sequences():
    kinds = {gap: {n.split("-")[0] for n in dataset.SETS[gap]} for gap in SETS}
    both = {"augmented", "realistic"}
    assert kinds == {"high": {"augmented"}, "low": both, "robust": both | {"varied"},
                     "slim": both | {"varied", "printed"}}  # fmt: skip


@pytest.mark.parametrize("path", sorted(WEIGHTS.glob("*.safetensors")), ids=lambda p: p.stem)
def test_shipped_weights_were_trained_on_their_gaps_kinds_of_sequences(path):
    card, gap = load_card(path), path.stem.split("-")[2]
    kinds = {s.split("-")[0] for s in card["training_sequences"] + card["validation_sequences"]}
    assert kinds == {name.split("-")[0] for name in dataset.SETS[gap]}


@pytest.mark.parametrize("count", [10_000, PAPER.events_per_window, 45_000])
def test_any_number_of_events_is_a_histogram_symmetric_in_time(recording, folder, count):
    """The first N events of a sample are N consecutive events of the recording, about the mask's time."""
    samples = dataset.Samples(["mini"], "ring", "event", folder)
    events, width = recording.events, recording.camera.width_px
    rows, middles_us = dataset.sample_events(recording, 3)
    for i, (row, middle_us) in enumerate(zip(rows, middles_us, strict=True)):
        known = int((row != dataset.NO_EVENT).sum())
        assert known >= PAPER.events_per_window
        asked = min(count, known)
        away_us = np.abs(events["t_us"] - middle_us)
        reach_us = np.partition(away_us, asked - 1)[asked - 1]
        inner, outer = events[away_us < reach_us], events[away_us <= reach_us]
        image = samples.image(i, count).astype(int)
        assert image.sum() == asked
        for subset, sign in ((inner, 1), (outer, -1)):  # ties in time may fall either way
            bound = histogram(subset["x"], subset["y"], recording.camera.size_px).astype(int)
            assert (sign * (image - bound) >= 0).all()
        assert row[:asked].max() < width * recording.camera.height_px


def test_masks_are_those_of_the_true_pose_at_the_image_s_time(recording, folder, port):
    frames = dataset.Samples(["mini"], "ring", "rgb", folder)
    markers = dataset.Samples(["mini"], "reflector", "rgb", folder)
    assert len(frames) == 3
    for i, k in enumerate(np.linspace(0, len(recording.frames) - 1, 3).astype(int)):
        assert np.array_equal(frames.image(i), recording.frames[k])
        pose = recording.truth.at(recording.frames_t_us[[k]])[0]
        ring, marker = labels.label_masks(pose, port, recording.camera)
        assert np.array_equal(frames.mask(i), ring)
        assert np.array_equal(markers.mask(i), marker)
        assert frames.mask(i).any()
        both = frames.mask(i) & markers.mask(i)  # pixels half of which is ring and the other half marker
        assert both.sum() <= 0.01 * frames.mask(i).sum()


def test_prior_is_the_share_of_positive_pixels(folder):
    samples = dataset.Samples(["mini"], "ring", "rgb", folder)
    assert samples.positive_share() == pytest.approx(np.mean([samples.mask(i).mean() for i in range(3)]))


def test_making_goes_on_where_it_was_and_leaves_nothing_half_done(tmp_path, monkeypatch, recording):
    made = []

    def simulate(name, seconds):
        made.append(name)
        if name == "augmented-1" and made.count(name) == 1:
            raise KeyboardInterrupt
        return recording

    monkeypatch.setattr(dataset.sequences, "simulate", simulate)
    names = [f"augmented-{i}" for i in range(3)]
    with pytest.raises(KeyboardInterrupt):
        dataset.make_samples(names, tmp_path, 1, lambda line: None, count=1)
    assert sorted(p.name for p in tmp_path.iterdir()) == names[:1]
    dataset.make_samples(names, tmp_path, 1, lambda line: None, count=1)
    assert made == ["augmented-0", "augmented-1", "augmented-1", "augmented-2"]
    assert sorted(p.name for p in tmp_path.iterdir()) == names
    assert len(dataset.Samples(names, "ring", "rgb", tmp_path).made_of()) == 12


def test_processes_make_what_one_process_makes(tmp_path):
    names, size = ["augmented-0", "augmented-1"], dict(seconds=0.2, count=1)
    dataset.make_samples(names, tmp_path / "two", 2, lambda line: None, **size)
    dataset.make_samples(names[:1], tmp_path / "one", 1, lambda line: None, **size)
    paths = sorted((tmp_path / "one" / names[0]).glob("*.npy"))
    assert len(paths) == 4
    for path in paths:
        assert np.array_equal(np.load(path), np.load(tmp_path / "two" / names[0] / path.name))


@pytest.mark.parametrize("content", [b"", b"PK", 300])
def test_damaged_samples_are_one_line(tmp_path, content):
    path = tmp_path / "event.npy"
    np.save(path, np.zeros(999))
    path.write_bytes(path.read_bytes()[:content] if isinstance(content, int) else content)
    with pytest.raises(InputError, match=r"event\.npy: damaged samples .*; delete their folder"):
        dataset._memory_map(path)


def test_a_pipe_among_samples_is_refused(tmp_path):
    os.mkfifo(tmp_path / "event.npy")
    with pytest.raises(InputError, match=r"event\.npy: is a device or a pipe"):
        dataset._memory_map(tmp_path / "event.npy")
