"""A network in ONNX gives the masks that it gives in torch, of images of any size and number."""

import numpy as np
import onnxruntime
import pytest
import torch

from lmmap.pipeline.network import CHANNELS, FilterNet, MaskNetwork
from lmmap.pipeline.weights import WEIGHTS, load_filter
from lmmap_lab.training.onnx_graph import BOTH, filter_model

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


def session_of(net, modality, name="ring"):
    content = filter_model(net, name, modality, {}).SerializeToString()
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


def test_networks_of_other_widths(rng):
    check(FilterNet(1, widths=(5, 7, 4)), "event", rng)


def test_networks_whose_convolutions_are_split(rng):
    check(FilterNet(1, widths=(4, 6, 8), depthwise=True), "event", rng)


def test_a_joint_network_gives_both_masks(rng):
    torch.manual_seed(1)
    net = FilterNet(1, (0.5, 0.3), (4, 6, 8))
    session, image = session_of(net, "event", BOTH), some_images("event", (21, 30), rng)
    (found,) = session.run(["mask"], {"image": image[:, None].astype(np.float32)})
    np.testing.assert_allclose(found[0], MaskNetwork(net, "event", "float32")(image[0]), atol=1e-4)


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
