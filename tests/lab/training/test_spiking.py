"""Spiking neurons keep every charge and fire as ReLUs let pass, and so does a network of them."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from lmmap.pipeline.histograms import histogram
from lmmap.pipeline.network import FilterNet, encode
from lmmap_lab.training.slices import SliceSamples, encode_slices
from lmmap_lab.training.spiking import Neurons, Spike, SpikingNet, activations, ceilings_of, sliced

SHAPE = (16, 24)
slices = st.integers(2, 40)


def column(values) -> torch.Tensor:
    """Values (K,) as neurons of one channel."""
    return torch.tensor(values, dtype=torch.float64).reshape(1, 1, 1, -1)


def neurons(count: int, signed: bool, **options) -> Neurons:
    """Neurons that let pass 1 if they fire in each of ``count`` slices."""
    return Neurons(torch.full((1, 1, 1), 1 / count), signed, **options)


@pytest.mark.parametrize("signed", [False, True])
@given(slices, st.lists(st.floats(-2, 2), min_size=1, max_size=8))
def test_on_constant_input_rates_are_what_a_relu_lets_pass_to_a_slice(signed, count, values):
    layer = neurons(count, signed)
    for _ in range(count):
        layer(column(values) / count)
    relu = column(values).clamp(0, 1)
    assert (layer.fired - relu).abs().max() <= 1 / count + 1e-5


@pytest.mark.parametrize("signed", [False, True])
@pytest.mark.parametrize("pooled", [False, True])
def test_a_reset_keeps_the_charge(signed, pooled, rng):
    layer, sent, brought = neurons(7, signed, pooled=pooled), 0, 0
    for _ in range(30):
        current = torch.from_numpy(rng.normal(0, 0.3, (2, 1, 4, 6)).astype(np.float32))
        sent, brought = sent + layer(current), brought + current
    inside = torch.nn.functional.max_pool2d(brought, 2) if pooled else brought
    torch.testing.assert_close(layer.membrane + sent, inside + layer.threshold / 2)


@given(slices, st.lists(st.floats(-1, 1), min_size=1, max_size=30))
def test_a_signed_neuron_follows_any_input_of_a_threshold_a_slice(count, currents):
    layer = neurons(count, signed=True)
    for current in currents:
        layer(column([current / count]))
        assert (layer.fired - layer.drive.clamp(min=0)).abs().max() <= 0.5 / count + 1e-5


def test_a_plain_neuron_cannot_take_a_spike_back():
    plain, signed = (neurons(4, kind) for kind in (False, True))
    for current in (0.25, -0.25, 0.0, 0.0):
        plain(column([current])), signed(column([current]))
    assert plain.fired.item() == 0.25 and signed.fired.item() == 0


def test_a_pooled_neuron_follows_the_largest_sum_where_spikes_in_turn_would_add_up():
    count = 4
    pooled, each, of_spikes = neurons(count, False, pooled=True), neurons(count, False), 0
    for turn in range(count):
        current = torch.zeros(1, 1, 2, 2)
        current.view(-1)[turn] = 0.25
        pooled(current)
        of_spikes += each(current).amax()
    assert pooled.fired.item() == 0.25  # as max-pooling of the sums
    assert of_spikes.item() == 1.0  # max-pooling of spikes: four times too much


def test_slices_together_are_the_histogram_s_input(rng):
    pixels = np.minimum(rng.geometric(0.02, 2000), np.prod(SHAPE)) - 1
    counts = histogram(pixels % SHAPE[1], pixels // SHAPE[1], SHAPE[::-1])
    assert counts.max() > 8  # some are saturated
    for count in (1, 7, 30):
        parts = sliced(pixels, SHAPE, count)
        assert parts.shape == (count, *SHAPE) and parts.min() >= 0
        np.testing.assert_allclose(parts.sum(0), encode(counts[None], "event")[0, 0], rtol=1e-6)
    first = sliced(pixels[:1000], SHAPE, 1)[0]
    np.testing.assert_allclose(sliced(pixels, SHAPE, 2)[0], first)


@pytest.fixture
def net():
    torch.manual_seed(3)
    net = FilterNet(1)
    for layer in [*net.down, *net.up]:
        torch.nn.init.normal_(layer.bias, 0, 0.1)
    return net.eval().requires_grad_(False)


@pytest.mark.parametrize("signed", [False, True])
def test_with_many_slices_of_constant_input_the_network_is_the_ordinary_one(net, signed):
    x = torch.rand(2, 1, *SHAPE)  # below the ceilings, or neurons could not catch up with those before them
    ceilings = [1.5 * layer.amax((0, 2, 3)).clamp(min=1e-3) for layer in activations(net, x)]
    ordinary, errors = net(x), []
    for count in (4, 32, 256):
        spiking = SpikingNet(net, count, signed, ceilings)
        logits = spiking((x / count).repeat(count, 1, 1, 1))
        errors.append(((logits - ordinary).abs().mean() / ordinary.std()).item())
    assert errors[2] < 0.5 * errors[1] < 0.25 * errors[0]
    assert errors[2] < 0.05


def test_at_any_time_a_signed_network_follows_the_ordinary_one_on_what_has_come(net):
    count, x = 256, torch.rand(1, 1, *SHAPE)
    ceilings = [layer.amax((0, 2, 3)).clamp(min=1e-3) for layer in activations(net, x)]
    spiking = SpikingNet(net, count, True, ceilings)
    for t, (logits, _) in enumerate(spiking.answers((x / count).repeat(count, 1, 1, 1)), 1):
        if t in (count // 2, 3 * count // 4, count):
            ordinary = net(x * t / count)
            assert (logits - ordinary).abs().mean() < 0.05 * ordinary.std()


def test_each_window_of_a_batch_has_its_own_neurons(net):
    windows, count = torch.rand(3, 5, 1, *SHAPE) / 5, 5
    ceilings = [torch.ones(len(layer.bias)) for layer in [*net.down, *net.up[:2]]]
    spiking = SpikingNet(net, count, True, ceilings)
    together = spiking(windows.transpose(0, 1).flatten(0, 1))
    alone = torch.cat([spiking(window) for window in windows])
    torch.testing.assert_close(together, alone, atol=1e-4, rtol=1e-4)


def test_ceilings_are_the_largest_quantiles_of_what_relus_let_pass(net):
    images = [torch.rand(1, 1, *SHAPE) for _ in range(3)]
    largest = ceilings_of(net, images, share=1.0)
    every = [torch.stack(layer) for layer in zip(*(activations(net, x) for x in images), strict=True)]
    for ceiling, layer in zip(largest, every, strict=True):
        np.testing.assert_allclose(ceiling, layer.amax((0, 1, 3, 4)).clamp(min=1e-3), rtol=1e-6)
    assert all((low <= high).all() for low, high in zip(ceilings_of(net, images, 0.5), largest, strict=True))


def test_backward_a_triangle_stands_for_a_spike():
    above = torch.tensor([-2.0, -0.5, 0.0, 0.25, 3.0], requires_grad=True)
    spikes = Spike.apply(above)
    spikes.sum().backward()
    assert spikes.tolist() == [0, 0, 1, 1, 1]
    assert above.grad.tolist() == [0, 0.5, 1, 0.75, 0]


@pytest.mark.parametrize("signed", [False, True])
def test_surrogate_gradients_lower_the_loss(net, signed):
    x, target = torch.rand(4, 1, *SHAPE).repeat(3, 1, 1, 1) / 3, torch.zeros(4, 1, *SHAPE)
    ceilings = [layer.amax((0, 2, 3)).clamp(min=1e-3) for layer in activations(net, x[:4])]
    spiking = SpikingNet(net, 3, signed, ceilings).requires_grad_(True)
    adam, losses = torch.optim.Adam(spiking.parameters(), 1e-3), []
    for _ in range(8):
        loss = torch.nn.functional.binary_cross_entropy_with_logits(spiking(x), target)
        adam.zero_grad()
        loss.backward()
        adam.step()
        losses.append(loss.item())
    assert losses[-1] < 0.9 * losses[0]
    assert all(p.grad.abs().sum() > 0 for p in [*spiking.net.parameters(), *spiking.ceilings])


def test_samples_come_in_slices_in_the_order_of_time(tmp_path, rng):
    folder, pixels = tmp_path / "augmented-0", rng.integers(0, np.prod(SHAPE), (2, 60)).astype(np.uint32)
    folder.mkdir()
    np.save(folder / "event.npy", pixels)
    np.save(folder / "event_labels.npy", np.ones((2, *SHAPE), np.uint8))
    samples = SliceSamples(["augmented-0"], "ring", "event", tmp_path, 6)
    batch = encode_slices(np.stack([samples.image(i) for i in range(2)]))
    assert batch.shape == (12, 1, *SHAPE) and batch.dtype == torch.float32
    for window in range(2):
        np.testing.assert_allclose(batch[window::2, 0], sliced(pixels[window], SHAPE, 6))
    assert samples.mask(0).all()
