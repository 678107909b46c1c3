"""The mask networks, which the paper calls filters: an image in, a mask of the ring or of the markers out.

One architecture for all four (ring | reflectors, RGB | event), the paper's: three convolutions with
ReLU and max-pooling, three transposed convolutions with ReLU between them, skip connections as in
U-Net (Ronneberger et al. 2015), a sigmoid at the end, nothing fully connected.  Each output depends
on the input within `RECEPTIVE_RADIUS_PX` only, which is what makes the method satellite-agnostic.
"""

from __future__ import annotations

import os
from copy import deepcopy
from itertools import pairwise
from typing import Any, cast

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

WIDTHS = (64, 128, 256)
SATURATION = 8  # events of a pixel: more are not told apart
STRIDE_PX = 2 ** len(WIDTHS)
KERNEL = 3  # of every convolution, along each axis
CHANNELS = {"rgb": 3, "event": 1}
PRECISIONS = {"float32": torch.float32, "bfloat16": torch.bfloat16}


def inputs_of(first: int, last: int) -> tuple[int, int]:
    """The first and the last input, along one axis, on which the outputs ``first`` to ``last`` depend.

    A transposed convolution of stride 2 gives ``y[2i]`` from ``x[i]`` and ``y[2i + 1]`` from ``x[i]`` and
    ``x[i + 1]``; a convolution reaches half its kernel to each side, and pooling takes pairs.
    """
    for _ in WIDTHS:
        first, last = first // 2, (last + 1) // 2
    for _ in WIDTHS:
        first, last = 2 * first - KERNEL // 2, 2 * last + 1 + KERNEL // 2
    return first, last


# an output depends on no input further away along an axis; outputs one stride apart depend on alike inputs
RECEPTIVE_RADIUS_PX = max(abs(end - at) for at in range(STRIDE_PX) for end in inputs_of(at, at))


class FilterNet(nn.Module):
    """Logits (N, M, H, W) of images (N, C, H, W) of any size, padded internally to whole strides by repeating
    their edges.  The paper's networks give one mask each, M = 1.

    Parameters
    ----------
    channels : number of channels of the images
    prior : fraction of positive pixels that an untrained network expects, or one for each of M masks
    widths : channels after each convolution; the paper's are `WIDTHS`
    depthwise : make the inner convolutions depthwise separable (Howard et al. 2017)
    """

    def __init__(self, channels: int, prior=0.5, widths=WIDTHS, depthwise: bool = False):
        super().__init__()
        a, b, c = widths
        priors = np.atleast_1d(prior)
        side: dict[str, Any]
        up: dict[str, Any]
        side, up = dict(padding=KERNEL // 2), dict(stride=2, padding=KERNEL // 2, output_padding=1)
        down: list = [nn.Conv2d(i, o, KERNEL, **side) for i, o in pairwise((channels, a, b, c))]
        ends = (c, b), (2 * b, a), (2 * a, len(priors))
        back: list = [nn.ConvTranspose2d(i, o, KERNEL, **up) for i, o in ends]
        if depthwise:
            down[1:] = [nn.Sequential(nn.Conv2d(i, i, KERNEL, **side, groups=i), nn.Conv2d(i, o, 1))
                        for i, o in ((a, b), (b, c))]  # fmt: skip
            back[:2] = [nn.Sequential(nn.Conv2d(i, o, 1), nn.ConvTranspose2d(o, o, KERNEL, **up, groups=o))
                        for i, o in ((c, b), (2 * b, a))]  # fmt: skip
        self.down, self.up = nn.ModuleList(down), nn.ModuleList(back)
        layer: Any
        for layer in self.modules():
            if hasattr(layer, "weight"):
                nn.init.kaiming_normal_(layer.weight)
                nn.init.zeros_(layer.bias)
        back[-1].weight.data *= len(priors) ** 0.5  # as if each mask were the only one
        # rare pixels: start at the prior, or cross-entropy spends its first epochs learning it
        back[-1].bias.data[:] = torch.from_numpy(np.log(priors / (1 - priors)))

    @classmethod
    def shaped_as(cls, tensors, channels: int, masks: int = 1) -> FilterNet:
        """An untrained network with the widths of the tensors in a state dict."""
        widths = [next(len(tensors[n]) for n in (f"down.{k}.1.weight", f"down.{k}.weight") if n in tensors)
                  for k in range(len(WIDTHS))]  # fmt: skip
        return cls(channels, [0.5] * masks, widths, depthwise="down.1.1.weight" in tensors)

    def forward(self, x):
        height, width = x.shape[-2:]
        # zeros would be an edge beside a noisy background, where training's crops have none
        x = F.pad(x, (0, -width % STRIDE_PX, 0, -height % STRIDE_PX), mode="replicate")
        pooled = []
        for convolution in self.down:
            x = F.relu(F.max_pool2d(convolution(x), 2))  # ReLU after pooling: equal, and four times less
            pooled.append(x)
        x = torch.cat([F.relu(self.up[0](x)), pooled[1]], 1)
        x = F.relu(self.up[1](x)), pooled[0]
        return up_to_masks(x, self.up[2].weight, self.up[2].bias)[..., :height, :width]


def up_to_masks(parts, weight, bias):
    """The last transposed convolution, over the channels (N, C, H, W) of all parts together: one product for
    each pixel's nine taps of each mask, then sums by parity.  The result equals that of the general
    operation, which is made for many output channels and is several times slower here.

    Along one axis ``y[2i] = w[1] x[i]`` and ``y[2i + 1] = w[2] x[i] + w[0] x[i + 1]``.
    """
    kernels = weight.flatten(1).T.split([x.shape[1] for x in parts], 1)
    taps: Any = sum(F.conv2d(x, k[..., None, None]) for x, k in zip(parts, kernels, strict=True))
    exact = torch.promote_types(taps.dtype, torch.float32)
    taps = taps.to(exact).unflatten(1, (-1, 3, 3))
    for axis in (-2, -1):
        before, at, after = taps.unbind(2)
        following = F.pad(before.narrow(axis, 1, before.shape[axis] - 1), (0, axis == -1, 0, axis == -2))
        taps = torch.stack([at, after + following], axis).flatten(axis - 1, axis)
    return taps + bias.to(exact)[:, None, None]


def best_precision() -> str:
    """The value of the environment variable ``LMMAP_PRECISION``, else `faster_precision`."""
    return os.environ.get("LMMAP_PRECISION") or faster_precision()


def faster_precision() -> str:
    """``"bfloat16"`` if the processor multiplies it faster than float32, else ``"float32"``.

    It does with AMX, and with AMD's AVX-512 BF16.  Intel's without AMX took 1.2 times as long as float32.
    """
    has: dict = getattr(torch.cpu, "get_capabilities", dict)()
    intel = "intel" in str(has.get("cpu_name", "")).lower()
    fast = has.get("amx_bf16") or (has.get("avx512_bf16") and not intel)
    return "bfloat16" if fast else "float32"


def encode(images: np.ndarray, modality: str) -> torch.Tensor:
    """Network input (N, C, H, W) f32 in [0, 1] of RGB frames (N, H, W, 3) or histograms (N, H, W).

    Frames are linear in light: the square root spreads their dark half.  Counts saturate at `SATURATION`.
    """
    x = torch.from_numpy(np.array(images, np.float32))  # a copy: recordings are read-only
    if modality == "rgb":
        return (x / 255).sqrt().movedim(-1, 1)
    return (x.clamp(max=SATURATION) / SATURATION).unsqueeze(1)


class MaskNetwork:
    """A trained `FilterNet`, called on one image: ``(H, W, 3) u8`` or ``(H, W)`` counts -> ``(H, W)``, or
    ``(M, H, W)`` if it gives several masks.

    ``precision`` is ``"float32"``, ``"bfloat16"`` or ``"auto"`` (`best_precision`); masks are float32.

    Raises
    ------
    ValueError
        For another precision; in a call, for an image of another shape or with NaN or infinite values.
    """

    stride_px = STRIDE_PX  # what `crops.crop_bounds` cuts by
    inputs_of = staticmethod(inputs_of)

    def __init__(self, net: FilterNet, modality: str, precision: str = "auto"):
        self.modality, self.precision = modality, best_precision() if precision == "auto" else precision
        if self.precision not in PRECISIONS:
            raise ValueError(f"precision: expected 'auto' or one of {list(PRECISIONS)}, got {precision!r}")
        self._dtype = PRECISIONS[self.precision]
        # torch's stub of `to` leaves out the memory format
        self._net = cast(Any, deepcopy(net).eval()).to(dtype=self._dtype, memory_format=torch.channels_last)

    @torch.inference_mode()
    def __call__(self, image: np.ndarray) -> np.ndarray:
        shape = (None, None, 3) if self.modality == "rgb" else (None, None)
        if image.ndim != len(shape) or (shape[2:] and image.shape[2] != 3) or 0 in image.shape:
            raise ValueError(f"MaskNetwork: a {self.modality} image has shape {shape}, got {image.shape}")
        if not np.all(np.isfinite(image)):
            raise ValueError("MaskNetwork: the image holds NaN or infinite values")
        x = encode(image[None], self.modality).to(dtype=self._dtype, memory_format=torch.channels_last)
        logits = np.ascontiguousarray(self._net(x)[0].squeeze(0).float().numpy())
        with np.errstate(
            over="ignore"
        ):  # torch's sigmoid rounds the ends of rows otherwise than their middle
            return 1 / (1 + np.exp(-logits))


class TurnedToo:
    """Any network, applied to an image as it is and turned by 180 degrees: the mean of both masks.

    Part of a network's error is random and differs between the two.
    """

    def __init__(self, network):
        self._network = network
        if hasattr(network, "inputs_of"):
            self.stride_px, self.inputs_of = network.stride_px, self._inputs_of

    def __call__(self, image: np.ndarray) -> np.ndarray:
        turned = self._network(np.ascontiguousarray(image[::-1, ::-1]))
        return (self._network(image) + turned[..., ::-1, ::-1]) / 2

    def _inputs_of(self, first: int, last: int) -> tuple[int, int]:
        lowest, highest = self._network.inputs_of(first, last)
        reach = max(first - lowest, highest - last)  # to either side: a turn takes one for the other
        return first - reach, last + reach
