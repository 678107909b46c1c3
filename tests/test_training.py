"""Training: the split, the batches, and a run that was killed and went on."""

import json

import numpy as np
import pytest
import torch
from safetensors import safe_open

from lmmap import filters, training


@pytest.fixture
def toy(tmp_path, monkeypatch, rng):
    """Ten sequences of two small images with a bright square as the ring."""
    names = [f"augmented-{i}" for i in range(10)]
    for name in names:
        images, masks = rng.integers(0, 3, (2, 100, 104)).astype(np.uint8), np.zeros((2, 2, 100, 104), bool)
        row, column = rng.integers(20, 60, 2)
        masks[:, :, row : row + 12, column : column + 12] = True
        images[masks[:, 0]] = 7
        rgb = np.repeat(images[..., None], 3, -1)
        np.savez(tmp_path / f"{name}.npz", rgb=rgb, rgb_masks=masks, event=images, event_masks=masks)
    monkeypatch.setattr(training, "SETS", {"low": names})
    monkeypatch.setattr(filters, "WEIGHTS", tmp_path)
    return tmp_path


def test_split_is_by_sequence_and_complete():
    train, validate = training.split(training.SETS["low"])
    assert not set(train) & set(validate)
    assert sorted(train + validate) == sorted(training.SETS["low"])
    assert len(validate) == pytest.approx(0.2 * len(training.SETS["low"]), abs=1)
    assert {n.split("-")[0] for n in validate} == {"augmented", "realistic"}


def test_batches_repeat_and_masks_follow_their_images(toy):
    images, masks = training.load([f"augmented-{i}" for i in range(10)], "ring", "event", toy)
    recipe = training.Recipe("ring", "event", batch=4)
    x, y = training.batch(images, masks, recipe, 7)
    again = training.batch(images, masks, recipe, 7)[0]
    assert torch.equal(x, again)
    assert not torch.equal(x, training.batch(images, masks, recipe, 8)[0])
    assert torch.equal(x > 0.5, y > 0.5)


def test_a_killed_run_ends_as_an_unbroken_one(toy):
    recipe = training.Recipe("ring", "event", steps=6, batch=2)

    def final(stop_at=None):
        (toy / "ring-event-low-0.ckpt.safetensors").unlink(missing_ok=True)
        if stop_at:
            _run(recipe, toy, stop_at)
        path = training.train(recipe, toy, report=lambda line: None)
        return json.loads(path.with_suffix(".json").read_text())["curve"][-1]

    assert final(stop_at=3) == final()


def _run(recipe, folder, steps):
    """The first steps of a run, ended by a checkpoint and an exception."""

    class Killed(Exception):
        pass

    original = training.batch

    def batch(images, masks, recipe, step):
        if step == steps:
            raise Killed
        return original(images, masks, recipe, step)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(training, "CHECKPOINT_STEPS", 3)
        patch.setattr(training, "batch", batch)
        with pytest.raises(Killed):
            training.train(recipe, folder, report=lambda line: None)


def test_checkpoints_hold_no_pickle(toy):
    training.train(training.Recipe("ring", "event", steps=2, batch=2), toy, report=lambda line: None)
    with safe_open(toy / "ring-event-low-0.ckpt.safetensors", "pt") as file:
        assert json.loads(file.metadata()["recipe"])["steps"] == 2


def test_learns_a_bright_square(toy):
    path = training.train(
        training.Recipe("ring", "event", steps=40, batch=8, warm_up=5), toy, lambda line: None
    )
    curve = json.loads(path.with_suffix(".json").read_text())["curve"]
    assert curve[-1]["iou"] > 0.8
