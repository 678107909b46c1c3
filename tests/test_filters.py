"""The network's promises: size, locality, exact crops, safe loading."""

import json

import numpy as np
import pytest
import torch

from lmmap.core import InputError
from lmmap.filters import (
    CHANNELS,
    RECEPTIVE_RADIUS_PX,
    Filter,
    FilterNet,
    crop_bounds,
    encode,
    load_card,
    load_filter,
    save_weights,
    weight_path,
)


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
    filter_ = Filter(net(), "event")
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


def test_prior_is_the_first_output():
    torch.manual_seed(0)
    model = FilterNet(1, prior=0.02)
    with torch.inference_mode():
        assert torch.sigmoid(model(torch.zeros(1, 1, 32, 32))).mean() == pytest.approx(0.02, rel=1e-3)


def test_encoding_by_hand():
    assert encode(np.array([[[0, 4], [8, 100]]]), "event").squeeze().tolist() == [[0, 0.5], [1, 1]]
    assert encode(np.full((1, 2, 2, 3), 255, np.uint8), "rgb").shape == (1, 3, 2, 2)


def test_weights_round_trip_in_half_precision(tmp_path, rng):
    path = tmp_path / "ring-event-low.safetensors"
    model = net()
    save_weights(model, path, {"command": "none"})
    image = rng.integers(0, 6, (64, 64))
    assert load_card(path)["command"] == "none"
    assert np.abs(load_filter(path, "event")(image) - Filter(model, "event")(image)).max() < 0.02


def test_damaged_weights_are_one_clear_error(tmp_path):
    path = tmp_path / "w.safetensors"
    with pytest.raises(InputError, match="no readable weights"):
        load_filter(path, "event")
    save_weights(net(), path, {})
    with pytest.raises(InputError, match="another architecture"):
        load_filter(path, "rgb")
    whole = path.read_bytes()
    for length in (0, 5, 200, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        with pytest.raises(InputError, match="no readable weights"):
            load_filter(path, "event")
    path.write_bytes(whole[:-1] + bytes([whole[-1] ^ 1]))
    with pytest.raises(InputError, match="hash differs"):
        load_filter(path, "event")


def test_bad_images():
    filter_ = Filter(net(), "event")
    with pytest.raises(ValueError, match="shape"):
        filter_(np.zeros((8, 8, 3)))
    with pytest.raises(ValueError, match="NaN"):
        filter_(np.full((8, 8), np.nan))


@pytest.mark.parametrize("name", ["ring", "reflector"])
@pytest.mark.parametrize("modality", ["rgb", "event"])
@pytest.mark.parametrize("gap", ["low", "high"])
def test_shipped_weights_load_and_say_how_they_were_made(name, modality, gap):
    path = weight_path(name, modality, gap)
    load_filter(path, modality)
    card = load_card(path)
    assert card["command"].startswith(f"lmmap train --filter {name} --modality {modality}")
    assert card["curve"][-1]["step"] == card["recipe"]["steps"]
    assert not set(card["training_sequences"]) & set(card["validation_sequences"])
    kinds = {s.split("-")[0] for s in card["training_sequences"] + card["validation_sequences"]}
    assert kinds == ({"augmented"} if gap == "high" else {"augmented", "realistic"})
    assert json.dumps(card)
