"""Checkpoints: what was saved comes back, and whatever is damaged is one line."""

import os

import pytest
import torch
from strategies import line

from lmmap.pipeline.network import FilterNet
from lmmap_lab.training.checkpoint import resume, save_checkpoint
from lmmap_lab.training.recipe import Recipe

RECIPE = Recipe("ring", "event", steps=5)


def trained():
    torch.manual_seed(0)
    net = FilterNet(1)
    adam = torch.optim.Adam(net.parameters(), 1e-3)
    net(torch.zeros(1, 1, 32, 32)).sum().backward()
    adam.step()
    return net, adam


@pytest.fixture
def path(tmp_path):
    save_checkpoint(tmp_path / "c.safetensors", *trained(), RECIPE, 3, [{"step": 3}])
    return tmp_path / "c.safetensors"


def test_it_comes_back_for_its_recipe_alone(path):
    net, adam = trained()
    with torch.no_grad():
        for p in net.parameters():
            p.zero_()
    assert resume(path, net, adam, Recipe("ring", "event", steps=6)) == (0, [])
    assert resume(path, net, adam, RECIPE) == (3, [{"step": 3}])
    assert all(torch.equal(a, b) for a, b in zip(net.parameters(), trained()[0].parameters(), strict=True))
    assert resume(path.with_name("none"), net, adam, RECIPE) == (0, [])


def test_any_damage_is_one_line(path):
    whole, net = path.read_bytes(), trained()
    places = [*range(0, 2000, 97), *range(len(whole) // 2, len(whole), len(whole) // 15), len(whole) - 1]
    for k in places:
        path.write_bytes(whole[:k] + bytes([whole[k] ^ 4]) + whole[k + 1 :])
        assert "delete it to start anew" in line(resume, path, *net, RECIPE), k
        path.write_bytes(whole[:k])
        assert str(path) in line(resume, path, *net, RECIPE)
    for make in (os.mkfifo, os.mkdir, lambda path: os.symlink("/proc/kmsg", path)):
        path.unlink()
        make(path)
        assert str(path) in line(resume, path, *net, RECIPE)
        path.rmdir() if path.is_dir() else path.unlink()
        path.write_bytes(whole)
