"""One network that produces both masks in about half the time that two need, because the ring and the
markers are recognized from much the same features.

It is stored as two filters, one for each mask, that differ only in their last layer.  Each also works alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch

from .network import CHANNELS, FilterNet, MaskNetwork, TurnedToo

LAST = {"up.2.weight": 1, "up.2.bias": 0}  # tensors of the last layer, and their axis of masks


class OneMask:
    """One mask (H, W) of a network that gives several."""

    def __init__(self, network, index: int):
        self.network, self.index = network, index
        self.stride_px, self.inputs_of = network.stride_px, network.inputs_of

    def __call__(self, image):
        return self.network(image)[self.index]


def common(first, second):
    """The network that computes both masks; None if each has its own."""
    both = isinstance(first, OneMask) and isinstance(second, OneMask) and first.network is second.network
    return first.network if both else None


def mask_networks(filters: Sequence[FilterNet], modality: str, precision: str) -> list:
    """A callable for each filter's mask; filters that differ only in their last layer share one network."""
    if joint := join(filters, modality):
        return _masks_of(MaskNetwork(joint, modality, precision), len(filters))
    return [MaskNetwork(net, modality, precision) for net in filters]


def turned_too(networks: Sequence) -> list:
    """`TurnedToo` of each network, or of the one that they share."""
    if (joint := common(*networks)) is not None:
        return _masks_of(TurnedToo(joint), len(networks))
    return [TurnedToo(network) for network in networks]


def join(filters: Sequence[FilterNet], modality: str) -> FilterNet | None:
    """One network with the masks of all filters; None unless they differ only in their last layer."""
    first, *others = tensors = [net.state_dict() for net in filters]
    same = [name for name in first if name not in LAST]
    if not all(name in t and torch.equal(first[name], t[name]) for t in others for name in same):
        return None
    joint = FilterNet.shaped_as(first, CHANNELS[modality], len(filters))
    last = {name: torch.cat([t[name] for t in tensors], axis) for name, axis in LAST.items()}
    joint.load_state_dict(first | last)
    return joint


def apart(joint: FilterNet, modality: str) -> list[FilterNet]:
    """The filter of each mask of a network."""
    tensors, filters = joint.state_dict(), []
    for k in range(len(tensors["up.2.bias"])):
        filters.append(FilterNet.shaped_as(tensors, CHANNELS[modality]))
        last = {name: tensors[name].narrow(axis, k, 1) for name, axis in LAST.items()}
        filters[k].load_state_dict(tensors | last)
    return filters


def _masks_of(network, count: int) -> list[OneMask]:
    return [OneMask(network, index) for index in range(count)]
