"""Drawings, the table and the figure with a slider of the chapter on networks."""

from __future__ import annotations

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from lmmap.pipeline import ellipse
from lmmap.pipeline.ring import binarise, skeleton_points
from lmmap.settings import OURS, Settings
from lmmap.types import Camera, Ellipse, Port, Pose

from ..bench import labels
from .drawings import COLOUR, show_image
from .sliders import Step
from .tables import CAMERAS, with_ends

INPUTS = {"counts": "counts", "few": "counts, half as many covers", "polarity": "counts of each polarity",
          "surface": "counts and a time surface", "slim": "slim: counts", "robust": "robust: counts",
          "further": "robust, trained further"}  # fmt: skip
FITS = {"iou": "overlap", "skeleton_px": "skeleton error (px)"}


def inputs_table(inputs: pd.DataFrame) -> pd.DataFrame:
    """Texts: how often each network finds the ring, and what it gains, with a 95 % interval."""
    rows = inputs.set_index("network").loc[list(INPUTS)].rename(index=INPUTS)
    ends = rows[["gain", "gain_low", "gain_high"]].to_numpy()
    gains = [("+" if gain > 0 else "") + with_ends(gain, low, high, ".1f") for gain, low, high in ends]
    gains[0], gains[-1] = "", f"{gains[-1]} over robust"
    texts = {"circle right (%)": rows.right_percent.map("{:.1f}".format), "gain over counts": gains}
    return pd.DataFrame(texts, index=rows.index).rename_axis("network and input")


def draw_architecture(ax, net, size_px) -> None:
    """The layers of a `FilterNet` as boxes, as tall as their maps; their width grows with the channels.

    The sizes are those of a pass of an image of ``size_px`` (width, height) through the network.
    """
    shapes = _layer_shapes(net, size_px)
    x, tops = 0.0, []
    for name, (channels, height, width) in shapes:
        w, h = 0.25 + 0.25 * np.log2(max(channels, 1)) / 2, 4.0 * height / shapes[0][1][1]
        colour = COLOUR["rgb"] if name.startswith("down") else COLOUR["event"]
        colour = colour if name != "input" else COLOUR["ink"]
        ax.add_patch(plt.Rectangle((x, -h / 2), w, h, facecolor=colour, alpha=0.6, edgecolor=COLOUR["ink"]))
        ax.text(x + w / 2, -2.35, f"{channels}\n{width} x {height}", ha="center", va="top", fontsize=8)
        tops.append((x + w / 2, h / 2))
        x += w + 0.75
    for (a, b), level in zip(((1, 5), (2, 4)), (2.9, 2.45), strict=True):  # the skips
        (xa, ya), (xb, yb) = tops[a], tops[b]
        ax.plot([xa, xa, xb, xb], [ya, level, level, yb], color=COLOUR["truth"], lw=1.2)
    ax.set(xlim=(-0.3, x), ylim=(-3.2, 3.2))
    ax.set_axis_off()


def _layer_shapes(net, size_px) -> list[tuple[str, tuple]]:
    """``(name, (channels, height, width))`` of the input and of each stage's output."""
    import torch

    outputs = []
    layers = [
        *((f"down {i}", m) for i, m in enumerate(net.down)),
        *((f"up {i}", m) for i, m in enumerate(net.up[:2])),
    ]
    hooks = [
        m.register_forward_hook(lambda m, i, o, n=n: outputs.append((n, o.shape[1:]))) for n, m in layers
    ]
    width, height = size_px
    channels = net.down[0].in_channels
    with torch.inference_mode():
        last = net(torch.zeros(1, channels, height, width))
    for hook in hooks:
        hook.remove()
    pooled = [(n, (s[0], s[1] // 2, s[2] // 2) if n.startswith("down") else tuple(s)) for n, s in outputs]
    return [("input", (channels, height, width)), *pooled, ("up 2", tuple(last.shape[1:]))]


def mask_errors(predicted, truth) -> np.ndarray:
    """A picture (H, W, 3) of two boolean masks: right pixels green, superfluous orange, missed blue."""
    picture = np.zeros((*truth.shape, 3))
    classes = (predicted & truth, "truth"), (predicted & ~truth, "event"), (~predicted & truth, "ours")
    for pixels, colour in classes:
        picture[pixels] = matplotlib.colors.to_rgb(COLOUR[colour])
    return picture


def judge_masks(
    image, modality: str, T_cam_port: Pose, networks, port: Port, settings: Settings = OURS
) -> np.ndarray:
    """Picture (H, W, 3) of what the masks of ring and markers have right, too much, and missed.

    ``networks`` are those of the ring and the markers, by ``(filter, modality)``.
    """
    ring, markers = (networks[name, modality](image) for name in ("ring", "reflector"))
    guess = binarise(ring), markers > settings.mask_threshold
    truth = labels.label_masks(T_cam_port, port, Camera.davis346())
    return np.maximum(*map(mask_errors, guess, truth))


def draw_masks(axes, pictures, networks, port: Port) -> None:
    """Each picture, and beside it its `judge_masks`.

    Parameters
    ----------
    axes : (N, 2)
    pictures : N tuples of a title, the modality, the image, and the true pose
    """
    for (left, right), (title, modality, image, T_cam_port) in zip(axes, pictures, strict=True):
        show_image(left, image, title)
        show_image(right, judge_masks(image, modality, T_cam_port, networks, port))


def mask_table(table: pd.DataFrame):
    """`mask_quality.medians` by light, styled: a row per network, a column per measure of fit and light."""
    words = {"modality": CAMERAS, "filter": {"reflector": "markers"},
             "domain_gap": {"high": "high-gap", "low": "low-gap"}}  # fmt: skip
    names = {"domain_gap": "networks", "filter": "mask of", "modality": "camera"}
    renamed, rows = table.replace(words).rename(columns=FITS | names), list(names.values())
    wide = renamed.pivot_table(list(FITS.values()), rows, "light", sort=False)
    return wide.style.format(precision=2, na_rep="none")


def threshold_steps(mask, levels, truth: Ellipse, rng: np.random.Generator) -> tuple[list[Step], np.ndarray]:
    """What a mask (H, W) gives at each threshold: its skeleton, and the ellipse if there is any.

    Beside the steps, by how many pixels the centre of each ellipse is off; infinite where there is none.
    """
    steps, off_px = [], []
    for level in levels:
        points = skeleton_points(mask, level)
        answer, inliers = ellipse.fit_ransac(points, rng)
        contour = np.empty((0, 2)) if answer is None else answer.points(180)
        off_px.append(np.inf if answer is None else np.linalg.norm(answer.centre_px - truth.centre_px))
        title = "no ellipse" if answer is None else (
            f"centre off by {off_px[-1]:.2f} px, "
            f"{100 * ellipse.arc_coverage(answer, points[inliers]):.0f} % of the contour seen")  # fmt: skip
        curves = (
            ("skeleton", points, "event", "markers"),
            ("ellipse", contour, "ours", "lines"),
            ("truth", truth.points(180), "truth", "lines"),
        )
        binary = binarise(mask, level).astype(float)
        steps.append(Step(f"{level:g}", f"{len(points)} skeleton points; {title}", binary, curves))
    return steps, np.array(off_px)
