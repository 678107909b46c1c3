"""What spiking networks are worth: how often a spike is added up, and means with intervals."""

import numpy as np
import pandas as pd
import pytest
import torch

from lmmap.pipeline.network import FilterNet, up_to_masks
from lmmap.types import Camera, Port, Pose
from lmmap_lab.bench import labels
from lmmap_lab.studies import spikes
from lmmap_lab.training.spiking import SpikingNet


@pytest.fixture
def ones():
    """A network whose weights are one, and which has no biases: an output is the number of paths to it."""
    net = FilterNet(1).requires_grad_(False)
    for layer in [*net.down, *net.up]:
        torch.nn.init.ones_(layer.weight), torch.nn.init.zeros_(layer.bias)
    return net


def test_a_neuron_has_as_many_connections_as_its_impulse_reaches(ones):
    def impulse(channels):
        x = torch.zeros(1, channels, 9, 9)
        x[0, 0, 4, 4] = 1
        return x

    last = ones.up[2]
    nothing = torch.zeros(1, 128, 9, 9)
    to_last = up_to_masks((impulse(128),), last.weight, last.bias).sum()
    after_down_1 = torch.cat([nothing[:, :128], impulse(128)], 1)
    reached = [ones.down[0](impulse(1)).sum(), ones.down[1](impulse(64)).sum() + to_last,
               ones.down[2](impulse(128)).sum() + ones.up[1](after_down_1).sum(),
               ones.up[0](impulse(256)).sum(), ones.up[1](impulse(256)).sum(), to_last]  # fmt: skip
    assert spikes.fan_out(ones) == [int(count) for count in reached]


def window(rng, camera, events=400):
    pixels = rng.integers(0, np.prod(camera.size_px), events)
    return spikes.Window(pixels, np.arange(events), None)


def test_operations_of_silence_and_of_one_layer(ones, rng):
    camera = Camera.davis346()
    seen = window(rng, camera)
    of_layers = [torch.full((64,), 1e9), *(torch.full((n,), 1e9) for n in (128, 256, 128, 64))]
    silent = spikes.spiking_operations(SpikingNet(ones, 2, False, of_layers), seen, camera)
    assert silent["synaptic"] == 400 * 9 * 64 and silent["spikes_a_neuron"] == 0  # the events alone
    height, width = 264, 352
    inputs = height * width * (64 + 128 / 4 + 256 / 16 + 128 / 16 + 64 / 4 + 1)
    assert silent["operations"] - silent["synaptic"] == 2 * inputs  # biases, in two slices
    ordinary = spikes.ordinary_operations(ones, seen, camera)
    fan, sizes = spikes.fan_out(ones), (1, 64 / 4, 128 / 16, 256 / 64, 128 / 16, 64 / 4)
    assert ordinary["operations"] == sum(height * width * s * n for s, n in zip(sizes, fan, strict=True))
    assert 0 < ordinary["operations_needed"] < ordinary["operations"]
    assert ordinary["millijoule"] == pytest.approx(1e-9 * 4.6 * ordinary["operations"])


def rows(light, values):
    """One row a window; ``values`` by sequence."""
    facts = [({"sequence": f"{light}-{k}"}, value) for k, of in enumerate(values) for value in of]
    table = pd.DataFrame([fact | dict.fromkeys(spikes.MEASURES, float(value)) for fact, value in facts])
    return table.assign(network="a", light=light)


def test_means_are_of_windows_and_intervals_of_sequences(rng):
    values = rng.random(30)
    once = pd.concat([rows("low", values[:15, None]), rows("high", values[15:, None])])
    twice = pd.concat([once, once])  # a second look at the same sequences says nothing new
    first, second = (spikes.with_intervals(table, ["network"]).iloc[0] for table in (once, twice))
    assert first.iou_ring == pytest.approx(values.mean()) and second.windows == 2 * first.windows == 60
    assert second.sequences == 30
    for column in ("iou_ring", "iou_ring_low", "iou_ring_high"):
        assert second[column] == pytest.approx(first[column])
    error = values.std() / np.sqrt(30)
    assert first.iou_ring_high - first.iou_ring_low == pytest.approx(2 * 1.96 * error, rel=0.35)


def test_each_light_keeps_its_sequences():
    """Where all of a light are alike, no draw changes its share."""
    table = pd.concat([rows("low", [[100]] * 5), rows("high", [[0]] * 5)])
    answer = spikes.with_intervals(table, ["network"]).iloc[0]
    assert answer.right_percent_low == answer.right_percent == answer.right_percent_high == 50


def test_events_seen_end_at_the_whole_window_and_slices_fit_them():
    assert spikes.EVENTS[-1] == 35_000
    for count in (spikes.WATCHED, spikes.TRAINED_SLICES):
        assert set(spikes.EVENTS) <= {t * 35_000 // count for t in range(1, count + 1)}


@pytest.mark.parametrize("kind", ["ordinary", *spikes.KINDS])
def test_masks_of_a_crop_are_the_whole_image_s_within_the_box_and_zero_elsewhere(kind, rng):
    camera, port = Camera.davis346(), Port.lm_map()
    pose = Pose(np.diag([1.0, -1.0, -1.0]), np.array([-0.05, 0.02, 0.9]))
    seen = window(rng, camera, 35_000)._replace(truth_at=lambda t_us: pose[None])
    net = spikes.ordinary_net("ring") if kind == "ordinary" else spikes.spiking_net("ring", kind, 2)
    of = spikes.ordinary_masks if kind == "ordinary" else spikes.spiking_masks
    crop, whole = spikes.crop_around(seen, camera, port), np.s_[0:260, 0:346]
    (*_, of_crop), (*_, of_whole) = (
        of("", [net], seen, each, camera) for each in (crop, crop._replace(given=whole))
    )
    assert np.prod([s.stop - s.start for s in crop.given]) < 0.5 * 260 * 346
    np.testing.assert_allclose(of_crop.masks[0], of_whole.masks[0], atol=1e-4)
    outside = np.ones((260, 346), bool)
    outside[crop.box] = False
    true_masks = labels.label_masks(pose, port, camera)
    assert true_masks.any((1, 2)).all() and not true_masks[:, outside].any()
    assert (of_crop.masks[0] > 0.01).any() and not of_crop.masks[0][outside].any()
