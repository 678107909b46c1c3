"""Training: the batches, and a run that was killed and went on."""

import json
import resource
from dataclasses import replace

import numpy as np
import pytest
import torch
import toy_training
from safetensors import safe_open
from safetensors.torch import load_file

from lmmap.pipeline import joint_network, network, weights
from lmmap.settings import PAPER
from lmmap.types import InputError
from lmmap_lab.training import augment, batches, dataset, learning, train
from lmmap_lab.training.recipe import Recipe


@pytest.fixture
def toy(tmp_path, monkeypatch, rng):
    """Ten sequences of two small images with a bright square as the ring."""
    names = toy_training.write_samples(tmp_path, rng)
    monkeypatch.setattr(dataset, "SETS", {gap: names for gap in weights.SETS})
    monkeypatch.setattr(weights, "WEIGHTS", tmp_path)
    return tmp_path


def quiet(line):
    pass


@pytest.mark.parametrize("gap", ["low", "robust"])
@pytest.mark.parametrize("modality", ["rgb", "event"])
def test_batches_are_a_function_of_seed_and_step(toy, gap, modality):
    samples = dataset.Samples(dataset.SETS["low"], "ring", modality, toy)
    recipe = Recipe("ring", modality, gap, batch=4, crop_px=48)
    x, y = train.make_batch(samples, recipe, 7)
    assert x.shape == (4, network.CHANNELS[modality], 48, 48)
    assert y.shape == (4, 1, 48, 48)
    assert set(y.unique().tolist()) <= {0, 1}
    again = train.make_batch(samples, recipe, 7)
    assert torch.equal(x, again[0])
    assert torch.equal(y, again[1])
    assert not torch.equal(x, train.make_batch(samples, recipe, 8)[0])


def test_masks_follow_their_images(toy):
    samples = dataset.Samples(dataset.SETS["low"], "ring", "event", toy)
    x, y = train.make_batch(samples, Recipe("ring", "event", batch=8), 3)
    assert torch.equal(x > 0.5, y > 0.5)


def test_most_crops_hold_positives(toy):
    samples = dataset.Samples(dataset.SETS["low"], "ring", "event", toy)

    def share(positive):
        recipe = Recipe("ring", "event", batch=40, crop_px=24, positive_crops=positive)
        return train.make_batch(samples, recipe, 0)[1].amax((1, 2, 3)).mean()

    assert share(1.0) == 1
    assert share(0.0) < 0.6


@pytest.mark.parametrize("gap", ["low", "robust"])
def test_a_killed_run_ends_as_an_unbroken_one(toy, gap):
    recipe = Recipe("ring", "event", gap, steps=6, batch=2)

    def final(stop_at=None):
        for path in toy.glob("*.ckpt.safetensors"):
            path.unlink()
        if stop_at:
            _run(recipe, toy, stop_at)
        path = train.train(recipe, toy, quiet)
        last = json.loads(path.with_suffix(".json").read_text())["curve"][-1]
        return path.read_bytes(), last["loss"], last["iou"]

    assert final(stop_at=4) == final()


def _run(recipe, folder, steps):
    """The first steps of a run, ended by an exception one step after its checkpoint."""

    class Killed(Exception):
        pass

    original = train.make_batch

    def batch(samples, recipe, step, encode):
        if step == steps:
            raise Killed
        return original(samples, recipe, step, encode)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(train, "make_batch", batch)
        with pytest.raises(Killed):
            train.train(recipe, folder, quiet, every=steps - 1)


def test_another_start_is_another_run(toy):
    """A robust set whose low one was trained anew must not end as the old one did."""
    robust = Recipe("ring", "event", "robust", steps=2, batch=2, start_from="low")
    seen = []
    for batch in (2, 3):
        train.train(Recipe("ring", "event", "low", steps=2, batch=batch), toy, quiet)
        seen.append(train.train(robust, toy, quiet).read_bytes())
    assert seen[0] != seen[1]
    assert len(list(toy.glob("ring-event-robust-from-*.ckpt.safetensors"))) == 2


def test_another_recipe_does_not_resume_and_a_damaged_checkpoint_is_one_clear_error(toy):
    first = Recipe("ring", "event", steps=1, batch=2)
    train.train(first, toy, quiet)
    path = toy / "ring-event-low.ckpt.safetensors"
    with safe_open(path, "pt") as file:  # tensors and text: nothing that runs
        assert json.loads(file.metadata()["recipe"])["steps"] == 1
    other = Recipe("ring", "event", steps=2, batch=2)
    curve = json.loads(train.train(other, toy, quiet).with_suffix(".json").read_text())["curve"]
    assert [p["step"] for p in curve] == [2]
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(InputError, match="no readable checkpoint"):
        train.train(other, toy, quiet)


@pytest.mark.parametrize("limit", [10_000, 4_000_000])
def test_a_full_disk_is_one_clear_error_and_costs_neither_weights_nor_checkpoint(toy, limit):
    """A limit on the size of files stands for the disk.  The second cuts the checkpoint alone."""
    first = train.train(Recipe("ring", "event", steps=1, batch=2), toy, quiet)
    files = [first, first.with_suffix(".json"), *toy.glob("*.ckpt.safetensors")]
    before = [path.read_bytes() for path in files]
    net = network.FilterNet(1, 0.1)
    hard = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    try:
        with pytest.raises(InputError, match="cannot write"):
            train.train(Recipe("ring", "event", steps=2, batch=2), toy, quiet)
        if limit < len(before[0]):
            with pytest.raises(InputError, match="cannot write"):
                weights.save_weights(net, first, {})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
    assert [path.read_bytes() for path in files] == before
    assert not list(toy.glob(".*"))


def test_a_disk_that_is_full_before_the_card_keeps_the_old_weights(toy, monkeypatch):
    path = train.train(Recipe("ring", "event", steps=1, batch=2), toy, quiet)
    before = path.read_bytes(), path.with_suffix(".json").read_bytes()

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(type(path), "write_text", full)
    with pytest.raises(InputError, match="No space left"):
        weights.save_weights(network.FilterNet(2, 0.1), path, {})
    assert (path.read_bytes(), path.with_suffix(".json").read_bytes()) == before


def test_learns_a_bright_square_and_says_how(toy):
    lines, modality = [], "event"
    recipe = Recipe("ring", modality, steps=40, batch=8, warm_up=5)
    path = train.train(recipe, toy, lines.append)
    card = json.loads(path.with_suffix(".json").read_text())
    assert card["curve"][-1]["iou"] > 0.6
    assert card["command"] == recipe.command
    assert card["training_images"] == 16
    assert card["bench"] == "toy"
    assert "step 40 of 40" in lines[-1]
    image = dataset.Samples(["augmented-4"], "ring", modality, toy).image(0)
    assert weights.load_network(path, modality)(image).shape == toy_training.SHAPE


def test_a_run_may_start_from_other_weights(toy):
    train.train(Recipe("ring", "event", "low", steps=3, batch=2), toy, quiet)
    recipe = Recipe("ring", "event", "robust", steps=1, batch=2, rate=0.0, start_from="low")
    path = train.train(recipe, toy, quiet)
    first, last = (
        weights.load_filter(toy / f"ring-event-{gap}.safetensors", "event").state_dict()
        for gap in ("low", "robust")
    )
    assert all(torch.equal(first[k], last[k]) for k in first)
    assert weights.load_card(path)["command"].endswith("--start-from low")
    with pytest.raises(InputError, match=r"--start-from low: .* widths of robust; start from another set"):
        learning.untrained(replace(recipe, width=0.5), 0.1)


class TinyNet(torch.nn.Conv2d):
    """A filter of one convolution."""

    def __init__(self, channels, prior=0.5):
        super().__init__(channels, 1, 3, padding=1)
        torch.nn.init.constant_(self.bias, np.log(prior / (1 - prior)))


def test_checkpoints_of_weights_elsewhere_stay_with_them(toy, tmp_path):
    """A script that trains variants does not end, or begin anew, the training of a shipped filter."""
    train.train(Recipe("ring", "event", steps=1, batch=2), toy, quiet, tmp_path / "own" / "a.safetensors")
    assert not list(toy.glob("ring-event-low.ckpt.*"))
    assert (tmp_path / "own" / "ring-event-low.ckpt.safetensors").exists()


def test_another_network_trains_and_is_another_run(toy):
    recipe, paths = Recipe("ring", "event", steps=2, batch=2), [toy / f"{n}.safetensors" for n in "ab"]
    for path in paths:  # the second run goes on from the first one's checkpoint, which was at its end
        train.train(recipe, toy, quiet, path, network=TinyNet)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    tensors = load_file(paths[0])
    assert {name: tuple(t.shape) for name, t in tensors.items()} == {"weight": (1, 1, 3, 3), "bias": (1,)}
    card = weights.load_card(paths[0])
    assert card["network"] == "TinyNet" and [point["step"] for point in card["curve"]] == [2]
    torch.manual_seed(recipe.seed)
    first = TinyNet(1, card["prior"]).weight.detach()
    assert (tensors["weight"].float() - first).abs().max() > 1e-6  # two steps have moved it
    ours = train.train(recipe, toy, quiet)
    assert "network" not in weights.load_card(ours) and len(load_file(ours)) > 2


def test_a_recipe_refuses_what_it_does_not_know():
    with pytest.raises(ValueError, match="filter is one of"):
        Recipe("rings", "event")
    with pytest.raises(InputError, match="at least 1"):
        Recipe("ring", "event", steps=0)


def test_the_paper_s_sets_see_the_paper_s_histograms(toy, monkeypatch):
    """Only the robust set varies N."""
    asked = []
    original = dataset.Samples.image
    monkeypatch.setattr(dataset.Samples, "image", lambda self, i, n: asked.append(n) or original(self, i, n))
    samples = dataset.Samples(dataset.SETS["low"], "ring", "event", toy)
    train.make_batch(samples, Recipe("ring", "event", "low", batch=4), 0)
    assert set(asked) == {PAPER.events_per_window}
    asked.clear()
    train.make_batch(samples, Recipe("ring", "event", "robust", batch=4), 0)
    low, high = np.array(augment.HISTOGRAM_EVENTS) * PAPER.events_per_window
    assert len(set(asked)) == 4
    assert low <= min(asked) < max(asked) <= high


def test_what_ships_is_made_by_the_default_command():
    """`lmmap train` without --steps repeats each shipped card's training; further seeds are asked for."""
    cards = sorted(weights.WEIGHTS.glob("*.json"))
    assert len(cards) >= 12
    for path in cards:
        card = weights.load_card(path)
        recipe = card["recipe"]
        default = Recipe.of_shipped(
            *(recipe[k] for k in ("filter", "modality", "networks")), seed=recipe["seed"]
        )
        assert default == Recipe(**recipe)
        assert default.command == card["command"] and default.name == path.stem


def test_the_papers_two_sets_are_trained_alike():
    low, high = (Recipe.of_shipped("ring", "event", gap) for gap in ("low", "high"))
    assert replace(low, networks="high") == high


def test_another_seed_leaves_the_shipped_weights_alone(toy):
    first = train.train(Recipe("ring", "event", steps=1, batch=2), toy, quiet)
    before = first.read_bytes()
    other = train.train(Recipe("ring", "event", seed=1, steps=1, batch=2), toy, quiet)
    assert other.name == "ring-event-low-seed1.safetensors" and first.read_bytes() == before
    assert other.read_bytes() != before


def test_the_rate_falls_along_one_cosine(toy):
    rates, original = [], torch.optim.Adam.step

    def step(self, *args, **kwargs):
        rates.append(self.param_groups[0]["lr"])
        return original(self, *args, **kwargs)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(torch.optim.Adam, "step", step)
        train.train(Recipe("ring", "event", steps=4, batch=2, warm_up=1, rate=0.1), toy, quiet)
    np.testing.assert_allclose(rates, [0.1, 0.05 + 0.05 / np.sqrt(2), 0.05, 0.05 - 0.05 / np.sqrt(2)])


def test_drawing_a_network_s_weights_leaves_torch_s_generator_alone():
    """And the seed, as torch itself understands it, decides them."""
    recipe = Recipe("ring", "rgb", "low", seed=3)
    torch.manual_seed(3)
    expected = network.FilterNet(network.CHANNELS["rgb"], 0.1, recipe.widths, recipe.depthwise).state_dict()
    torch.manual_seed(5)
    before = torch.random.get_rng_state()
    drawn = learning.untrained(recipe, 0.1).state_dict()
    assert torch.equal(torch.random.get_rng_state(), before)
    assert all(torch.equal(drawn[name], expected[name]) for name in expected)


def test_a_mean_of_true_and_taught_masks():
    net = network.FilterNet(1, widths=(2, 2, 2)).requires_grad_(False)
    x, y = torch.rand(1, 1, 16, 16), torch.ones(1, 1, 16, 16)
    assert batches.taught(None, x, y) is y
    np.testing.assert_allclose(batches.taught(net, x, y), (1 + torch.sigmoid(net(x))) / 2, rtol=1e-6)


def test_a_joint_network_learns_both_masks_and_is_saved_as_two_filters(toy):
    recipe = Recipe("joint", "event", steps=2, batch=2, width=1 / 16)
    ring = train.train(recipe, toy, quiet)
    names = [f"{name}-event-low.safetensors" for name in weights.FILTERS]
    paths = [ring.with_name(name) for name in names]
    filters = [weights.load_filter(path, "event") for path in paths]
    assert ring == paths[0] and joint_network.join(filters, "event") is not None
    cards = [weights.load_card(path) for path in paths]
    assert all(0 < card["prior"] < 0.5 and isinstance(card["curve"][-1]["iou"], float) for card in cards)
    assert cards[0]["prior"] > cards[1]["prior"] and cards[0]["command"] == cards[1]["command"]


def test_a_joint_batch_has_both_masks_of_the_same_crops(toy):
    recipe = Recipe("joint", "event", batch=8, crop_px=24, positive_crops=1.0)
    names = dataset.SETS["low"]
    samples = {name: dataset.Samples(names, name, "event", toy) for name in ("joint", *weights.FILTERS)}
    x, y = batches.make_batch(samples["joint"], recipe, 0)
    assert x.shape == (8, 1, 24, 24) and y.shape == (8, 2, 24, 24)
    both = [samples[name].mask(0) for name in weights.FILTERS]
    np.testing.assert_array_equal(augment.each_mask(samples["joint"].mask(0)), both)
    assert y.any((0, 2, 3)).all()
    shares = [samples[name].positive_share() for name in weights.FILTERS]
    assert samples["joint"].positive_share() == pytest.approx(shares)


def test_a_joint_network_begins_with_no_other():
    assert not Recipe.of_shipped("joint", "event", "robust").start_from
    assert not Recipe.of_shipped("joint", "event", "slim").teacher
    with pytest.raises(InputError, match="--start-from low: its networks have one mask each"):
        Recipe("joint", "event", "robust", start_from="low")
