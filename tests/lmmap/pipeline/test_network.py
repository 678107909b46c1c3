"""The network's promises: size, locality, exact crops, safe loading."""

import os

import drawn
import numpy as np
import pytest
import torch

from lmmap.estimation.images import images
from lmmap.pipeline.crops import crop_bounds
from lmmap.pipeline.network import (
    CHANNELS,
    RECEPTIVE_RADIUS_PX,
    FilterNet,
    MaskNetwork,
    best_precision,
    encode,
    inputs_of,
    up_to_masks,
)
from lmmap.pipeline.weights import (
    FILTERS,
    SETS,
    WEIGHTS,
    before,
    load_card,
    load_network,
    network_paths,
    save_weights,
    shipped_sets,
    weight_path,
)
from lmmap.types import InputError


def net(modality="event", seed=0):
    torch.manual_seed(seed)
    return FilterNet(CHANNELS[modality]).eval()


@pytest.mark.parametrize("modality, count", [("rgb", 814_529), ("event", 813_377)])
def test_parameters_are_about_800_k(modality, count):
    assert sum(p.numel() for p in net(modality).parameters()) == count


@pytest.mark.parametrize("size", [(260, 346), (264, 352), (17, 33), (8, 8)])
def test_output_has_the_input_size(size):
    with torch.inference_mode():
        assert net()(torch.zeros(1, 1, *size)).shape == (1, 1, *size)


def test_locality():
    """A change outside the receptive field leaves the output as it is; one inside does not."""
    model = net().double()
    x = torch.rand(1, 1, 128, 128, dtype=torch.double)
    with torch.inference_mode():
        before = model(x)[0, 0, 64, 65]
        outside, inside = x.clone(), x.clone()
        r = RECEPTIVE_RADIUS_PX
        keep = outside[..., 64 - r : 65 + r, 65 - r : 66 + r].clone()
        outside[...] = 7.0
        outside[..., 64 - r : 65 + r, 65 - r : 66 + r] = keep
        inside[..., 64, 65 + r] += 5.0
        assert model(outside)[0, 0, 64, 65] == pytest.approx(before.item(), abs=1e-12)
        assert abs(model(inside)[0, 0, 64, 65] - before) > 1e-9


def test_crop_equals_full_frame_and_a_smaller_margin_does_not(rng):
    filter_ = MaskNetwork(net(), "event", "float32")
    image = rng.integers(0, 6, (260, 346))
    full = filter_(image)
    low, high = np.array([101, 83]), np.array([190, 150])
    rows, columns = crop_bounds(low, high, (346, 260))
    part = np.zeros_like(full)
    part[rows, columns] = filter_(image[rows, columns])
    inside = np.s_[low[1] : high[1] + 1, low[0] : high[0] + 1]
    assert np.abs(part - full)[inside].max() < 1e-5
    tight_rows = slice(rows.start + 8, rows.stop - 8)
    tight = np.zeros_like(full)
    tight[tight_rows, columns] = filter_(image[tight_rows, columns])
    assert np.abs(tight - full)[inside].max() > 1e-4


@pytest.mark.parametrize("masks", [1, 2])
@pytest.mark.parametrize("size", [(1, 1), (5, 4), (9, 13)])
def test_last_layer_equals_the_transposed_convolution(size, masks):
    torch.manual_seed(1)
    layer = torch.nn.ConvTranspose2d(6, masks, 3, stride=2, padding=1, output_padding=1).double()
    x = torch.rand(2, 6, *size, dtype=torch.double)
    with torch.inference_mode():
        for parts in ([x], x.split([1, x.shape[1] - 1], 1)):
            assert torch.allclose(up_to_masks(parts, layer.weight, layer.bias), layer(x), atol=1e-12)


@pytest.mark.parametrize("modality", ["rgb", "event"])
def test_bfloat16_finds_the_same_mask(modality):
    _, image = list(images(drawn.recording(), modality))[10]
    path = weight_path("ring", modality)
    plain, fast = (load_network(path, modality, p)(image) for p in ("float32", "bfloat16"))
    assert fast.dtype == np.float32
    assert ((plain > 0.5) & (fast > 0.5)).sum() >= 0.98 * ((plain > 0.5) | (fast > 0.5)).sum() > 0


def test_precision_is_one_that_the_processor_has_or_that_was_asked_for(monkeypatch):
    monkeypatch.setenv("LMMAP_PRECISION", "float32")
    assert best_precision() == "float32"
    monkeypatch.delenv("LMMAP_PRECISION")
    assert MaskNetwork(net(), "event").precision == best_precision() in ("float32", "bfloat16")
    assert MaskNetwork(net(), "event", "float32").precision == "float32"
    with pytest.raises(ValueError, match="float64"):
        MaskNetwork(net(), "event", "float64")


@pytest.mark.parametrize("size", [(1, 1), (61, 480), (480, 640)])
def test_any_size_works_and_a_padded_image_gives_the_same_mask(size, rng):
    """Sizes never trained on: repeating the edges right and below, as the net does, changes nothing."""
    filter_, image = MaskNetwork(net(), "event", "float32"), rng.integers(0, 6, size)
    mask = filter_(image)
    whole = np.pad(image, [(0, -n % 8) for n in size], mode="edge")
    assert mask.shape == size
    assert np.abs(filter_(whole)[: size[0], : size[1]] - mask).max() < 1e-5


def test_prior_is_the_first_output():
    torch.manual_seed(0)
    model = FilterNet(1, prior=(0.02, 0.3))
    with torch.inference_mode():
        means = torch.sigmoid(model(torch.zeros(1, 1, 32, 32))).mean((0, 2, 3))
    assert means.tolist() == pytest.approx([0.02, 0.3], rel=1e-3)


def test_encoding_by_hand():
    assert encode(np.array([[[0, 4], [8, 100]]]), "event").squeeze().tolist() == [[0, 0.5], [1, 1]]
    assert encode(np.full((1, 2, 2, 3), 255, np.uint8), "rgb").shape == (1, 3, 2, 2)


def test_weights_round_trip_in_half_precision(tmp_path, rng):
    path = tmp_path / "ring-event-low.safetensors"
    model = net()
    save_weights(model, path, {"command": "none"})
    image = rng.integers(0, 6, (64, 64))
    assert load_card(path)["command"] == "none"
    loaded = load_network(path, "event", "float32")
    assert np.abs(loaded(image) - MaskNetwork(model, "event", "float32")(image)).max() < 0.02


def test_damaged_weights_are_one_clear_error(tmp_path):
    path = tmp_path / "w.safetensors"
    with pytest.raises(InputError, match="no readable weights"):
        load_network(path, "event")
    save_weights(net(), path, {})
    with pytest.raises(InputError, match="another architecture"):
        load_network(path, "rgb")
    whole = path.read_bytes()
    for length in (0, 5, 200, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(InputError, match="no readable weights"):
            load_network(path, "event")
    path.write_bytes(whole[:-1] + bytes([whole[-1] ^ 1]))
    with pytest.raises(InputError, match="hash differs"):
        load_network(path, "event")
    broken = net()
    torch.nn.init.constant_(broken.down[0].bias, torch.nan)
    save_weights(broken, path, {})
    with pytest.raises(InputError, match="not finite"):
        load_network(path, "event")


def test_weights_of_another_kind_and_cards_that_are_none(tmp_path):
    path = tmp_path / "w.safetensors"
    save_weights(net(), path, {})
    card = path.with_suffix(".json")
    for text in ("[]", "3", "null", '"text"', "{}", '{"sha256": 3}', "[" * 100_000, "", "9" * 5000):
        card.write_text(text)
        with pytest.raises(InputError, match=r"no readable weights|not a model card"):
            load_network(path, "event")
    for name in (path, card):
        save_weights(net(), path, {})
        with name.open("r+b") as file:
            file.truncate(6 * 10**9)
        with pytest.raises(InputError, match="6000000000 bytes"):
            load_network(path, "event")
        name.unlink()
        os.mkfifo(name)
        with pytest.raises(InputError, match="a device or a pipe"):
            load_network(path, "event")
        name.unlink()


def test_bad_images():
    filter_ = MaskNetwork(net(), "event")
    with pytest.raises(ValueError, match="shape"):
        filter_(np.zeros((8, 8, 3)))
    with pytest.raises(ValueError, match="shape"):
        filter_(np.zeros((0, 8)))
    with pytest.raises(ValueError, match="NaN"):
        filter_(np.full((8, 8), np.nan))


def test_weights_of_every_modality_and_filter_ship():
    """What `lmmap reproduce` needs; the robust set is complete or absent."""
    for gap in ("low", "high"):
        assert all(weight_path(f, m, gap).exists() for f in FILTERS for m in CHANNELS)
    robust = [weight_path(f, m, "robust").exists() for f in FILTERS for m in CHANNELS]
    assert all(robust) or not any(robust)
    assert shipped_sets() == [*SETS[:2], *SETS[2:] * all(robust)]


def test_a_former_name_of_a_set_is_still_taken():
    with pytest.warns(UserWarning, match="'light' are now called 'slim'"):
        assert network_paths("light", "rgb") == network_paths("slim", "rgb")
    assert before("light", "rgb") is None


@pytest.mark.parametrize("path", sorted(WEIGHTS.glob("*.safetensors")), ids=lambda p: p.stem)
def test_shipped_weights_load_and_say_how_they_were_made(path):
    name, modality, gap, *seed = path.stem.split("-")
    load_network(path, modality)
    card = load_card(path)
    assert card["command"].startswith(f"lmmap train --filter {name} --modality {modality} --networks {gap}")
    assert card["curve"][-1]["step"] == card["recipe"]["steps"]
    assert seed == ([f"seed{card['recipe']['seed']}"] if card["recipe"]["seed"] else [])
    assert not set(card["training_sequences"]) & set(card["validation_sequences"])


def test_crop_margins_follow_the_networks_stride_and_reach():
    """By hand: after three poolings outputs 0 to 7 depend on cells 0 and 1, and these on inputs -7 to 22."""
    assert inputs_of(0, 7) == (-7, 22) and inputs_of(1, 1)[1] == 22
    rows, columns = crop_bounds((100, 80), (140, 120), (346, 260))
    assert (rows, columns) == (slice(72, 144), slice(88, 160))

    class Pointwise:
        stride_px = 1
        inputs_of = staticmethod(lambda first, last: (first, last))

    assert crop_bounds((100, 80), (140, 120), (346, 260), Pointwise) == (slice(80, 121), slice(100, 141))
    assert crop_bounds((100, 80), (140, 120), (346, 260), lambda image: image) == (
        slice(0, 260),
        slice(0, 346),
    )


def test_a_mask_network_leaves_the_network_that_it_is_made_of_as_it_is():
    made_of = net().train()
    MaskNetwork(made_of, "event", "bfloat16")
    assert made_of.training and {p.dtype for p in made_of.parameters()} == {torch.float32}
