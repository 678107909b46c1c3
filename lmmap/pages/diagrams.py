"""Drawings of how things are made: the way from an image to a pose, and the layers of a filter."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np

from .drawings import COLOUR

# what is done, what it gives; learnt, geometric, or added by us
FLOW = (
    ("frame, or\n35 000 events", "image", "ink"), ("ring filter\n(CNN)", "mask", "event"),
    ("skeleton,\nRANSAC", "ellipse", "rgb"), ("circle's\ncone", "two poses", "rgb"),
    ("marker filter\n(CNN)", "mask", "event"), ("correlation\nwith CAD", "pose, yaw", "rgb"),
    ("joint\nrefinement", "covariance", "truth"), ("outlier\nfilter", "trajectory", "rgb"),
)  # fmt: skip


def draw_flow(ax) -> None:
    """The pipeline as boxes: orange is learnt, blue is geometry, green is not in the paper."""
    for k, (does, gives, colour) in enumerate(FLOW):
        x, y = k % 4, -(k // 4)
        box = {"boxstyle": "round,pad=0.45", "fc": COLOUR[colour] + "30", "ec": COLOUR[colour], "lw": 1.5}
        arrow = {"arrowstyle": "->", "color": COLOUR["ink"]}
        ax.text(x, y, does, ha="center", va="center", fontsize=9, bbox=box)
        ax.annotate("", (x + 0.65, y), (x + 0.36, y), arrowprops=arrow)
        ax.text(x + 0.5, y - 0.22, gives, ha="center", va="center", fontsize=8, style="italic")
    ax.set(xlim=(-0.4, 3.9), ylim=(-1.4, 0.4))
    ax.set_label("the pipeline: " + ", ".join(f"{does} to {gives}" for does, gives, _ in FLOW))
    ax.set_axis_off()


def draw_architecture(ax, net, size_px) -> None:
    """The layers of a `FilterNet` as boxes, as tall as their maps and as wide as their channels say;
    sizes are those of a pass through the net itself."""
    shapes = _shapes(net, size_px)
    x, tops = 0.0, []
    for name, (channels, height, width) in shapes:
        w, h = 0.25 + 0.25 * np.log2(max(channels, 1)) / 2, 4.0 * height / shapes[0][1][1]
        colour = COLOUR["rgb"] if name.startswith("down") else COLOUR["event"]
        colour = colour if name != "input" else COLOUR["ink"]
        ax.add_patch(plt.Rectangle((x, -h / 2), w, h, facecolor=colour, alpha=0.6, edgecolor=COLOUR["ink"]))
        ax.text(x + w / 2, -2.35, f"{channels}\n{width} x {height}", ha="center", va="top", fontsize=7)
        tops.append((x + w / 2, h / 2))
        x += w + 0.75
    for (a, b), level in zip(((1, 5), (2, 4)), (2.9, 2.45), strict=True):  # the skips
        (xa, ya), (xb, yb) = tops[a], tops[b]
        ax.plot([xa, xa, xb, xb], [ya, level, level, yb], color=COLOUR["truth"], lw=1.2)
    ax.set(xlim=(-0.3, x), ylim=(-3.2, 3.2))
    ax.set_axis_off()


def _shapes(net, size_px) -> list[tuple[str, tuple]]:
    """(name, (channels, height, width)) of the input and of what each stage gives on."""
    import torch

    found = []
    layers = [
        *((f"down {i}", m) for i, m in enumerate(net.down)),
        *((f"up {i}", m) for i, m in enumerate(net.up[:2])),
    ]
    hooks = [m.register_forward_hook(lambda m, i, o, n=n: found.append((n, o.shape[1:]))) for n, m in layers]
    width, height = size_px
    channels = net.down[0].in_channels
    with torch.inference_mode():
        last = net(torch.zeros(1, channels, height, width))
    for hook in hooks:
        hook.remove()
    pooled = [(n, (s[0], s[1] // 2, s[2] // 2) if n.startswith("down") else tuple(s)) for n, s in found]
    return [("input", (channels, height, width)), *pooled, ("up 2", tuple(last.shape[1:]))]
