"""One network that gives both masks, in half the time of two: ring and markers are found by much the same
features.

Its two masks are kept as the filters of the ring and of the markers, which differ in their last layer alone.
So each is also a filter like any other.
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
    """The network that gives the masks of both; None if they have none in common."""
    both = isinstance(first, OneMask) and isinstance(second, OneMask) and first.network is second.network
    return first.network if both else None


def mask_networks(filters: Sequence[FilterNet], modality: str, precision: str) -> list:
    """A callable for the mask of each filter; those of one joint network share it."""
    if joint := join(filters, modality):
        return _masks_of(MaskNetwork(joint, modality, precision), len(filters))
    return [MaskNetwork(net, modality, precision) for net in filters]


def turned_too(networks: Sequence) -> list:
    """`TurnedToo` of each network; those of one joint network share that."""
    if (joint := common(*networks)) is not None:
        return _masks_of(TurnedToo(joint), len(networks))
    return [TurnedToo(network) for network in networks]


def join(filters: Sequence[FilterNet], modality: str) -> FilterNet | None:
    """The network of all masks of filters that differ in their last layer alone; None of others."""
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
