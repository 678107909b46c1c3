"""What a network takes of what it learned."""

from copy import deepcopy

import torch

from lmmap.pipeline.network import CHANNELS, FilterNet
from lmmap_lab.adaptation import learning


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
