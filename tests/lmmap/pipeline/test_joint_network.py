"""One network of both masks is two filters that share all layers but the last."""

import numpy as np
import pytest
import torch

from lmmap.pipeline import joint_network
from lmmap.pipeline.crops import Box
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.masks import Expected, look
from lmmap.pipeline.network import CHANNELS, FilterNet, MaskNetwork, TurnedToo
from lmmap.pipeline.weights import load_networks, save_weights, weight_path


def joint_net(modality="event", masks=2):
    torch.manual_seed(3)
    return FilterNet(CHANNELS[modality], [0.1] * masks, widths=(4, 6, 8)).eval()


@pytest.fixture
def image(rng):
    return rng.integers(0, 6, (100, 140))


@pytest.fixture
def networks():
    return joint_network.mask_networks(joint_network.apart(joint_net(), "event"), "event", "float32")


@pytest.mark.parametrize("modality", CHANNELS)
def test_joining_undoes_taking_apart(modality):
    net = joint_net(modality)
    again = joint_network.join(joint_network.apart(net, modality), modality)
    assert all(torch.equal(net.state_dict()[name], t) for name, t in again.state_dict().items())


def test_filters_of_their_own_are_not_joined():
    first, second = joint_network.apart(joint_net(), "event")
    second.down[0].bias.data[0] += 1e-3
    assert joint_network.join([first, second], "event") is None
    wider = FilterNet(1, widths=(4, 6, 9))
    assert joint_network.join([first, wider], "event") is None
    assert joint_network.common(*joint_network.mask_networks([first, second], "event", "float32")) is None


def test_each_mask_is_that_of_its_filter(networks, image):
    filters = joint_network.apart(joint_net(), "event")
    for network, net in zip(networks, filters, strict=True):
        np.testing.assert_allclose(network(image), MaskNetwork(net, "event", "float32")(image), atol=1e-6)


def test_turned_too_is_that_of_each_mask(networks, image):
    turned = joint_network.turned_too(networks)
    assert joint_network.common(*turned) is not None
    for both, network in zip(turned, networks, strict=True):
        np.testing.assert_array_equal(both(image), TurnedToo(network)(image))


@pytest.mark.parametrize("where", ["anywhere", "expected"])
def test_a_look_runs_a_joint_network_once_and_sees_what_two_networks_see(networks, image, where, monkeypatch):
    ring, markers = (
        Box(np.array(low), np.array(high)) for low, high in (((30, 20), (90, 70)), ((50, 40), (100, 60)))
    )
    near = Expected(None, ring, markers) if where == "expected" else None
    alone = [lambda x, n=n: n(x) for n in networks]  # without a common network, on whole images
    seen, expected = look(image, *networks, near), look(image, *alone, near)
    calls, call = [], MaskNetwork.__call__
    monkeypatch.setattr(MaskNetwork, "__call__", lambda *a: calls.append(1) or call(*a))
    look(image, *networks, near)
    assert len(calls) == 1
    inside = np.s_[20:71, 30:91] if near else np.s_[:]
    np.testing.assert_allclose(seen.ring[inside], expected.ring[inside], atol=1e-6)
    of_markers = expected.reflectors if near else alone[1](image)
    inside = np.s_[40:61, 50:101] if near else np.s_[:]
    np.testing.assert_allclose(seen.reflectors[inside], of_markers[inside], atol=1e-6)


def test_weight_files_of_one_network_are_loaded_as_one(tmp_path):
    for name, net in zip(("ring", "reflector"), joint_network.apart(joint_net("rgb"), "rgb"), strict=True):
        save_weights(net, tmp_path / weight_path(name, "rgb").name, {})
    networks = load_networks(tmp_path, "rgb")
    assert joint_network.common(*networks) is not None
    estimator = Estimator(modality="rgb", weights=tmp_path)
    assert joint_network.common(estimator.ring_network, estimator.reflector_network) is not None
    assert joint_network.common(*load_networks("low", "rgb")) is None
