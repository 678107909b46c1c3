"""A mask network of spiking neurons, which takes events slice by slice and keeps no histogram.

It has the weights and the layers of a `FilterNet`.  In place of each ReLU are integrate-and-fire neurons with
soft reset: a neuron adds up what it gets, and when the sum reaches its threshold it fires, and the threshold
is taken off (Rueckauer et al. 2017).  T slices of a window bring together what its histogram holds, so after
T slices a neuron would have fired about as much as the ReLU lets pass, if all slices were alike.  They are
not: an event comes once.  A signed neuron can take a spike back (Wang et al. 2022).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from lmmap.pipeline.network import SATURATION, STRIDE_PX, FilterNet, up_to_masks

LEAST_CEILING = 1e-3  # of a channel that is silent in all images
SURROGATE_WIDTH = 1.0  # of the triangle that stands for the derivative of a spike, in thresholds


def sliced(pixels, shape: tuple[int, int], slices: int) -> np.ndarray:
    """Input (T, H, W) f32 of T slices with equally many events; their sum is the input of the histogram.

    A pixel is heard until it has sent `SATURATION` events.

    Parameters
    ----------
    pixels : (M,) int
        Pixel numbers ``y W + x`` of the events, in the order of time.
    """
    size = int(np.prod(shape))
    counts = [np.bincount(part, minlength=size) for part in np.array_split(pixels, slices)]
    heard = np.minimum(np.cumsum(counts, 0), SATURATION)
    return (np.diff(heard, axis=0, prepend=0) / SATURATION).reshape(-1, *shape).astype(np.float32)


class Spike(torch.autograd.Function):
    """1 where the argument is not negative, else 0; backward a triangle stands for the derivative."""

    @staticmethod
    def forward(ctx, above):
        """Spikes of what is above the threshold."""
        ctx.save_for_backward(above)
        return (above >= 0).to(above.dtype)

    @staticmethod
    def backward(ctx, gradient):
        """The gradient through a triangle about the threshold."""
        (above,) = ctx.saved_tensors
        return gradient * (1 - above.abs() / SURROGATE_WIDTH).clamp(min=0) / SURROGATE_WIDTH


class Neurons:
    """The neurons of one layer while a window lasts; each starts at half of its threshold.

    Parameters
    ----------
    threshold : (C, 1, 1)
    signed
        Whether a neuron takes back a spike, by one of the other sign, when its membrane falls below zero.
    pooled
        Whether a neuron has an input for each pixel of a 2 x 2 block, adds up each, and follows the largest
        sum.  To let through any spike of the block would add up the four, which fire in turn.

    Attributes
    ----------
    drive : (N, C, H, W)
        The sum of all input.
    fired : (N, C, h, w)
        Thresholds times spikes so far.  It and the membrane together are the drive and half a threshold.
    """

    def __init__(self, threshold: torch.Tensor, signed: bool, pooled: bool = False):
        self.threshold, self.signed, self.pooled = threshold, signed, pooled
        self.drive = self.fired = threshold.new_zeros(())

    @property
    def membrane(self) -> torch.Tensor:
        drive = F.max_pool2d(self.drive, 2) if self.pooled else self.drive
        return self.threshold / 2 + drive - self.fired

    def __call__(self, current: torch.Tensor) -> torch.Tensor:
        """The spikes (N, C, h, w) that one slice's input makes: a threshold where a neuron fires, else 0."""
        self.drive = self.drive + current.float()
        level = self.membrane / self.threshold
        spikes = Spike.apply(level - 1)
        if self.signed:
            spikes = spikes - Spike.apply(-level) * (self.fired > self.threshold / 2)
        self.fired = self.fired + self.threshold * spikes
        return self.threshold * spikes


class SpikingNet(nn.Module):
    """Logits (N, 1, H, W) of windows, whose slices are (T N, 1, H, W), the first slices of all first.

    Parameters
    ----------
    net
        The network that is converted; training changes its weights further.
    slices
        T.
    signed
        As in `Neurons`.
    ceilings : five tensors (C,)
        What a neuron of a channel has passed on if it fires in each slice: its threshold is 1 / T of that.
        `ceilings_of` finds them.
    """

    def __init__(self, net: FilterNet, slices: int, signed: bool, ceilings):
        super().__init__()
        self.net, self.slices, self.signed = net, slices, signed
        columns = [torch.as_tensor(ceiling, dtype=torch.float32)[:, None, None] for ceiling in ceilings]
        self.ceilings = nn.ParameterList([nn.Parameter(column) for column in columns])

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        *_, (logits, _) = self.answers(x)
        return logits

    def answers(self, x: torch.Tensor) -> Iterator[tuple[torch.Tensor, list[torch.Tensor]]]:
        """After each slice, the logits (N, 1, H, W) so far, and the spikes that it made in the five layers.

        Signed neurons get their biases with the first slice, so that they follow the ordinary network on the
        events so far.  Plain ones could not take back what a bias makes them fire; they get a part with each
        slice, and what the last layer has added up in t of T slices is taken T / t times.
        """
        height, width = x.shape[-2:]
        x = padded(x).unflatten(0, (self.slices, -1))
        thresholds = [ceiling / self.slices for ceiling in self.ceilings]
        layers = [Neurons(theta, self.signed, pooled=k < 3) for k, theta in enumerate(thresholds)]
        total = 0
        for t, slice_ in enumerate(x, 1):
            share, scale = (float(t == 1), 1) if self.signed else (1 / self.slices, self.slices / t)
            spikes, current = self._step(layers, slice_, share)
            total = total + current
            yield (total * scale)[..., :height, :width], spikes

    def _step(self, layers: list[Neurons], x: torch.Tensor, share: float):
        """The spikes that one slice and a share of the biases make, and what they add to the logits."""
        net, spikes = self.net, []
        for neurons, down in zip(layers[:3], net.down, strict=True):
            x = neurons(F.conv2d(x, down.weight, down.bias * share, padding=1))
            spikes.append(x)
        for neurons, up, beside in zip(layers[3:], net.up[:2], (spikes[1], spikes[0]), strict=True):
            spikes.append(neurons(F.conv_transpose2d(x, up.weight, up.bias * share, 2, 1, 1)))
            x = torch.cat([spikes[-1], beside], 1)
        return spikes, up_to_masks((x,), net.up[2].weight, net.up[2].bias * share)


def padded(x: torch.Tensor) -> torch.Tensor:
    """Images with their edges repeated to whole strides, as `FilterNet` does it."""
    return F.pad(x, (0, -x.shape[-1] % STRIDE_PX, 0, -x.shape[-2] % STRIDE_PX), mode="replicate")


@torch.inference_mode()
def activations(net: FilterNet, x: torch.Tensor) -> list[torch.Tensor]:
    """What the five ReLUs let pass (N, C, h, w), in the order of `SpikingNet.ceilings`."""
    x, passed = padded(x), []
    for down in net.down:
        x = F.relu(F.max_pool2d(down(x), 2))
        passed.append(x)
    for up, beside in zip(net.up[:2], (passed[1], passed[0]), strict=True):
        passed.append(F.relu(up(x)))
        x = torch.cat([passed[-1], beside], 1)
    return passed


def ceilings_of(net: FilterNet, images: Iterable[torch.Tensor], share: float = 0.999) -> list[np.ndarray]:
    """By channel, the largest of the images' (1, 1, H, W) quantiles of what each ReLU lets pass.

    ``share`` keeps a few bright pixels from making all thresholds coarse.
    """
    quantiles = [[np.quantile(a[0].flatten(1).cpu().numpy(), share, axis=1) for a in activations(net, image)]
                 for image in images]  # fmt: skip
    return [np.maximum(np.max(layer, axis=0), LEAST_CEILING) for layer in zip(*quantiles, strict=True)]
