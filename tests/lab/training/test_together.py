"""Trainings of many filters at once end as those of one."""

from dataclasses import replace

import numpy as np
import pytest
import test_train
import torch

from lmmap.pipeline import network, weights
from lmmap_lab.training import together, train
from lmmap_lab.training.recipe import Recipe

quiet, toy = test_train.quiet, test_train.toy
RECIPE = Recipe("ring", "event", "light", steps=6, batch=2, width=1 / 8)


def test_together_as_alone(toy):
    """Counts of events are exact in half precision, so that the weights are the same, too."""
    thin = replace(RECIPE, depthwise=True)
    train.train(replace(RECIPE, domain_gap="robust", width=1.0, steps=1), toy, quiet)
    recipes = {"plain": RECIPE, "thin": thin, "taught": replace(RECIPE, teacher="robust")}
    together.train_together(recipes, toy, toy / "together", quiet, workers=2)
    for label, recipe in recipes.items():
        alone = train.train(recipe, toy, quiet, toy / "alone" / label / "a.safetensors")
        assert alone.read_bytes() == (toy / "together" / f"{label}.safetensors").read_bytes()
        first, last = (weights.load_card(p) for p in (alone, toy / "together" / f"{label}.json"))
        assert first["curve"][-1]["iou"] == last["curve"][-1]["iou"] and first["recipe"] == last["recipe"]
    assert "teacher_sha256" in last


def test_a_killed_training_of_many_goes_on(toy, monkeypatch):
    def final(out, stop=None):
        def check(self, step, *args, original=together.Learner.check):
            original(self, step, *args)
            if step == stop and self.label == "b":
                raise KeyboardInterrupt

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(together.Learner, "check", check)
            recipes = {"a": RECIPE, "b": replace(RECIPE, width=1 / 4)}
            together.train_together(recipes, toy, out, quiet, every=2)
        return [(out / f"{name}.safetensors").read_bytes() for name in recipes]

    with pytest.raises(KeyboardInterrupt):
        final(toy / "killed", stop=2)
    assert final(toy / "killed") == final(toy / "whole")


def test_a_mean_of_true_and_taught_masks():
    net = network.FilterNet(1, widths=(2, 2, 2)).requires_grad_(False)
    x, y = torch.rand(1, 1, 16, 16), torch.ones(1, 1, 16, 16)
    from lmmap_lab.training.batches import taught

    assert taught(None, x, y) is y
    np.testing.assert_allclose(taught(net, x, y), (1 + torch.sigmoid(net(x))) / 2, rtol=1e-6)


def test_unequal_trainings_are_refused(toy):
    with pytest.raises(ValueError, match="equal steps"):
        together.train_together({"a": RECIPE, "b": replace(RECIPE, steps=7)}, toy, toy / "out", quiet)
