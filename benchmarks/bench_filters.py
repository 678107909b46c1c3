"""Ring and reflector filters on one frame: ours against plain eager float32 networks on full frames.

Interleaved in one run, medians.  Masks are compared where both were computed.
"""

from __future__ import annotations

import time

import numpy as np
import torch
from torch.nn import functional as F

from lmmap.filters import FILTERS, encode
from lmmap.pipeline import Estimator, images
from lmmap.recordings import open_recording
from lmmap.results import DATA

ROUNDS = 15


@torch.inference_mode()
def plain(net, image, modality):
    """The network as one writes it first: ReLU before pooling, channels first, the whole frame."""
    x = encode(image[None], modality)
    height, width = x.shape[-2:]
    x = F.pad(x, (0, -width % 8, 0, -height % 8))
    pooled = []
    for convolution in net.down:
        x = F.max_pool2d(F.relu(convolution(x)), 2)
        pooled.append(x)
    x = torch.cat([F.relu(net.up[0](x)), pooled[1]], 1)
    x = torch.cat([F.relu(net.up[1](x)), pooled[0]], 1)
    return torch.sigmoid(net.up[2](x)[0, 0, :height, :width]).numpy()


def contiguous(net):
    """A copy of a network with its weights in PyTorch's default layout."""
    copy = type(net)(net.down[0].in_channels)
    copy.load_state_dict(net.state_dict())
    return copy.eval().to(memory_format=torch.contiguous_format)


def main():
    recording = open_recording(DATA / "mini" / "test-medium.aedat4")
    print(f"threads {torch.get_num_threads()}")
    for modality in ("rgb", "event"):
        estimator = Estimator(recording.camera, modality=modality)
        nets = [contiguous(f._net) for f in (estimator.ring_filter, estimator.reflector_filter)]
        _, image = list(images(recording, modality))[-5]
        ellipse = estimator.find_ring(estimator.ring_filter(image))[0].ellipse
        seconds = {"plain": [], "ours": []}
        for _ in range(ROUNDS):
            start = time.perf_counter()
            peers = [plain(net, image, modality) for net in nets]
            middle = time.perf_counter()
            ours = [estimator.ring_filter(image), estimator.find_reflectors(image, ellipse)]
            seconds["plain"].append(middle - start)
            seconds["ours"].append(time.perf_counter() - middle)
        contour = ellipse.points().clip(0, recording.camera.size_px).astype(int)
        (left, top), (right, bottom) = contour.min(0), contour.max(0)
        inside = np.s_[top:bottom, left:right]
        off = max(np.abs(peers[0] - ours[0]).max(), np.abs((peers[1] - ours[1])[inside]).max())
        ms = {name: 1e3 * np.median(s) for name, s in seconds.items()}
        print(
            f"{modality:6} {' and '.join(FILTERS)}: plain {ms['plain']:.0f} ms, ours {ms['ours']:.0f} ms, "
            f"{ms['plain'] / ms['ours']:.2f}x; largest difference of a mask {off:.1e}"
        )


if __name__ == "__main__":
    main()
