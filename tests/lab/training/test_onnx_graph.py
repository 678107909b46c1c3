"""A network in ONNX gives the masks that it gives in torch, of images of any size and number."""

import numpy as np
import onnxruntime
import pytest
import torch
from torch import nn

from lmmap.pipeline.network import CHANNELS, FilterNet, MaskNetwork
from lmmap.pipeline.weights import WEIGHTS, load_filter
from lmmap_lab.training.onnx_graph import filter_model

SIZES = [(61, 83), (17, 33), (1, 9), (64, 48)]


def some_images(modality, size, rng, count=1):
    """Frames or histograms (N, H, W, ...) as an estimator takes them."""
    if modality == "rgb":
        return rng.integers(0, 256, (count, *size, 3)).astype(np.uint8)
    return rng.poisson(3, (count, *size)).astype(np.uint16)


def masks(session, images):
    """What a file gives of images, from numbers as its metadata describe them."""
    x = images if images.ndim == 4 else images[..., None]
    return session.run(["mask"], {"image": np.moveaxis(x, -1, 1).astype(np.float32)})[0][:, 0]


def session_of(net, modality):
    content = filter_model(net, "ring", modality, {}).SerializeToString()
    return onnxruntime.InferenceSession(content, providers=["CPUExecutionProvider"])


def check(net, modality, rng):
    session, ours = session_of(net, modality), MaskNetwork(net, modality, "float32")
    for size in SIZES:
        (image,) = images = some_images(modality, size, rng)
        np.testing.assert_allclose(masks(session, images)[0], ours(image), atol=1e-4)


@pytest.mark.parametrize("path", sorted(WEIGHTS.glob("*.safetensors")), ids=lambda p: p.stem)
def test_shipped_masks_are_equal_on_odd_sizes(path, rng):
    modality = path.stem.split("-")[1]
    check(load_filter(path, modality), modality, rng)


def narrow(a, b, c):
    torch.manual_seed(0)
    net, up = FilterNet(1), {"stride": 2, "padding": 1, "output_padding": 1}
    net.down = nn.ModuleList(nn.Conv2d(i, o, 3, padding=1) for i, o in ((1, a), (a, b), (b, c)))
    layers = ((c, b), (2 * b, a), (2 * a, 1))
    net.up = nn.ModuleList(nn.ConvTranspose2d(i, o, 3, **up) for i, o in layers)
    return net


def test_networks_of_other_widths(rng):
    check(narrow(5, 7, 4), "event", rng)


def test_networks_whose_convolutions_are_split(rng):
    """Each channel alone, then across channels, as in MobileNet."""
    net, up = narrow(4, 6, 8), {"stride": 2, "padding": 1, "output_padding": 1}
    net.down[1] = nn.Sequential(nn.Conv2d(4, 4, 3, padding=1, groups=4), nn.Conv2d(4, 6, 1))
    net.up[0] = nn.Sequential(nn.Conv2d(8, 6, 1), nn.ConvTranspose2d(6, 6, 3, groups=6, **up))
    check(net, "event", rng)


@pytest.mark.parametrize("modality", CHANNELS)
def test_images_in_a_batch_are_taken_one_by_one(modality, rng):
    torch.manual_seed(1)
    session, images = (
        session_of(FilterNet(CHANNELS[modality]), modality),
        some_images(modality, (21, 30), rng, 3),
    )
    each = np.concatenate([masks(session, image[None]) for image in images])
    np.testing.assert_allclose(masks(session, images), each, atol=1e-6)


def test_the_file_says_what_goes_in_and_comes_out():
    torch.manual_seed(2)
    session = session_of(FilterNet(3), "rgb")
    told, (image,), (mask,) = (
        session.get_modelmeta().custom_metadata_map,
        session.get_inputs(),
        session.get_outputs(),
    )
    assert (image.name, image.shape, image.type) == ("image", ["N", 3, "H", "W"], "tensor(float)")
    assert (mask.name, mask.shape, mask.type) == ("mask", ["N", 1, "H", "W"], "tensor(float)")
    assert "red, green and blue" in told["image"] and "0 to 255" in told["image"]
    assert "shows the ring" in told["mask"]
