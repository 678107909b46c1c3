"""What a network takes of what it learned."""

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
import torch

from lmmap.pipeline.network import CHANNELS, FilterNet
from lmmap.pipeline.weights import FILTERS
from lmmap_lab.adaptation import learning
from lmmap_lab.adaptation.self_labels import Labelled
from lmmap_lab.training import batches


@pytest.fixture
def task(rng):
    """Both networks of a camera, what they learn from, and how."""
    torch.manual_seed(0)
    nets = [FilterNet(CHANNELS["event"], widths=(4, 4, 4)) for _ in FILTERS]
    image, mask = rng.poisson(0.5, (96, 96)).astype(np.uint16), np.zeros((96, 96), bool)
    mask[30:60, 30:60] = True
    recipes = [learning.recipe_for(name, "event", 6, 0, "x") for name in FILTERS]
    return nets, [Labelled([image], [mask])] * 2, [replace(r, batch=2, crop_px=64) for r in recipes]


def same(a: FilterNet, b: FilterNet) -> bool:
    return all(torch.equal(x, b.state_dict()[name]) for name, x in a.state_dict().items())


@pytest.mark.parametrize("threads", [1, 2])
def test_networks_learn_at_once_what_each_learns_alone(task, threads, tmp_path):
    nets, samples, recipes = task
    before = torch.get_num_threads()
    for name in ("alone", "both"):
        (tmp_path / name).mkdir()
    try:
        torch.set_num_threads(1)
        alone = [learning.train_on(deepcopy(net), part, recipe, tmp_path / "alone")
                 for net, part, recipe in zip(nets, samples, recipes, strict=True)]  # fmt: skip
        torch.set_num_threads(threads)
        both = learning.train_both(deepcopy(nets), samples, recipes, tmp_path / "both")
    finally:
        torch.set_num_threads(before)
    assert all(same(*pair) for pair in zip(alone, both, strict=True))
    assert not any(same(*pair) for pair in zip(nets, both, strict=True))


def test_where_one_training_fails_the_other_stops(task, monkeypatch, tmp_path):
    nets, samples, recipes = task
    taken, step = [], batches.take_step

    def failing(net, adam, pair, recipe, k, *others):
        if recipe.filter == FILTERS[0]:
            raise KeyboardInterrupt
        taken.append(k)
        return step(net, adam, pair, recipe, k)

    monkeypatch.setattr(batches, "take_step", failing)
    recipes = [replace(recipe, steps=100_000) for recipe in recipes]
    with pytest.raises(KeyboardInterrupt):
        learning.train_both(nets, samples, recipes, tmp_path)
    assert len(taken) < 1000


def test_a_mean_of_networks_lies_between_them_and_leaves_both_as_they_were():
    old, new = (FilterNet(CHANNELS["event"], widths=(4, 4, 4)) for _ in range(2))
    kept = deepcopy(new.state_dict())
    for share, expected in ((0.0, old), (1.0, new)):
        mixed = learning.mean(old, new, share).state_dict()
        assert all(torch.allclose(mixed[name], value) for name, value in expected.state_dict().items())
    quarter = learning.mean(old, new, 0.25).state_dict()
    for name, value in quarter.items():
        assert torch.allclose(value, 0.75 * old.state_dict()[name] + 0.25 * new.state_dict()[name])
        assert torch.equal(kept[name], new.state_dict()[name])
