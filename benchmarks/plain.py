"""The filters in their plainest form, eager float32 networks on full frames: the peer of two benchmarks."""

from __future__ import annotations

import numpy as np
import torch
from torch.nn import functional as F

from lmmap.pipeline.network import CHANNELS, STRIDE_PX, FilterNet, encode
from lmmap.pipeline.weights import FILTERS, load_weights, weight_path


def nets(modality: str) -> list[FilterNet]:
    """Both filters' networks, in PyTorch's default layout."""
    filters = []
    for name in FILTERS:
        net = FilterNet(CHANNELS[modality])
        net.load_state_dict(load_weights(weight_path(name, modality), modality))
        filters.append(net.eval())
    return filters


@torch.inference_mode()
def mask(net: FilterNet, image: np.ndarray, modality: str) -> np.ndarray:
    """ReLU before pooling, channels first, the whole frame."""
    x = encode(image[None], modality)
    height, width = x.shape[-2:]
    x = F.pad(x, (0, -width % STRIDE_PX, 0, -height % STRIDE_PX), mode="replicate")
    pooled = []
    for convolution in net.down:
        x = F.max_pool2d(F.relu(convolution(x)), 2)
        pooled.append(x)
    x = torch.cat([F.relu(net.up[0](x)), pooled[1]], 1)
    x = torch.cat([F.relu(net.up[1](x)), pooled[0]], 1)
    return torch.sigmoid(net.up[2](x)[0, 0, :height, :width]).numpy()
