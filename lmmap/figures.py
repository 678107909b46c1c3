"""Figures: one style, colours by meaning, and the few drawings that chapters share."""

from __future__ import annotations

import cycler
import matplotlib
import matplotlib.pyplot as plt
import numpy as np

from .core import Camera, Ellipse, Estimate, Port, Pose, Recording
from .geometry import circle_points_m, project
from .pipeline import Estimator, images

# colours that colour-blind readers tell apart (after Okabe & Ito), readable on light and dark
COLOUR = {"rgb": "#0072B2", "event": "#D55E00", "truth": "#009E73", "paper": "#CC79A7", "ours": "#56B4E9",
          "rival": "#E69F00", "ink": "#8A8A8A"}  # fmt: skip

LINES = ("rgb", "event", "truth", "paper", "rival")


def use_style() -> None:
    """Transparent figures with grey ink, so that light and dark pages can both carry them."""
    ink = COLOUR["ink"]
    matplotlib.rcParams.update({
        "figure.facecolor": "none", "axes.facecolor": "none", "savefig.facecolor": "none",
        "savefig.transparent": True, "figure.dpi": 110, "figure.constrained_layout.use": True,
        "figure.figsize": (7.0, 3.2), "font.size": 9, "text.color": ink, "axes.labelcolor": ink,
        "axes.edgecolor": ink, "axes.titlecolor": ink, "xtick.color": ink, "ytick.color": ink,
        "axes.grid": True, "grid.alpha": 0.25, "grid.color": ink, "axes.spines.top": False,
        "axes.spines.right": False, "legend.frameon": False, "image.cmap": "gray", "svg.hashsalt": "lmmap",
        "axes.prop_cycle": cycler.cycler(color=[COLOUR[k] for k in LINES]),
    })  # fmt: skip


def interactive(fig, div_id: str):
    """A plotly figure as a page element that needs no network: plotly.js comes with the book."""
    from IPython.display import HTML

    fig.update_layout(template="none", paper_bgcolor="rgba(0,0,0,0)", plot_bgcolor="rgba(0,0,0,0)",
                      font_color=COLOUR["ink"])  # fmt: skip
    return HTML(fig.to_html(include_plotlyjs=False, full_html=False, div_id=div_id))


def show_image(ax, image, title: str = "") -> None:
    """An RGB frame, a mask or a histogram (its counts saturate at the 99.5th percentile)."""
    if image.ndim == 2 and image.dtype != bool:
        image = np.minimum(image / max(np.percentile(image, 99.5), 1e-9), 1)
    ax.imshow(image, vmin=0, vmax=1, interpolation="nearest")
    ax.set_title(title)
    ax.set_axis_off()


def strip(images, titles, width: float = 7.0):
    """A row of images under their titles."""
    aspect = images[0].shape[0] / images[0].shape[1]
    fig, axes = plt.subplots(1, len(images), figsize=(width, width / len(images) * aspect + 0.35))
    for ax, image, title in zip(np.atleast_1d(axes), images, titles, strict=True):
        show_image(ax, image, title)
    return fig, np.atleast_1d(axes)


def draw_port(
    ax, T_cam_port: Pose, port: Port, camera: Camera, colour: str = COLOUR["truth"], **style
) -> None:
    """The CAD's ring and markers at a pose, on an image."""
    rings = [circle_points_m(r, 90) for r in (port.ring_inner_radius_m, port.ring_outer_radius_m)]
    for points in (*rings, *port.marker_corners_m()):
        u, v = project(T_cam_port @ np.vstack([points, points[:1]]), camera).T
        ax.plot(u, v, color=colour, lw=style.get("lw", 1.0))


def draw_ellipse(ax, ellipse: Ellipse, colour: str = COLOUR["ours"], **style) -> None:
    u, v = ellipse.points(180).T
    ax.plot(np.append(u, u[0]), np.append(v, v[0]), color=colour, **{"lw": 1.0, **style})


def draw_estimate(
    ax, image, estimate: Estimate, port: Port, camera: Camera, truth: Pose | None = None
) -> None:
    """An image with the estimate (and the truth) drawn on it."""
    show_image(ax, image, str(estimate.status))
    if truth is not None:
        draw_port(ax, truth, port, camera, COLOUR["truth"])
    if estimate.T_cam_port is not None:
        draw_port(ax, estimate.T_cam_port, port, camera, COLOUR["event"])
    ax.set_xlim(-0.5, camera.width_px - 0.5)
    ax.set_ylim(camera.height_px - 0.5, -0.5)


def draw_pipeline(recording: Recording, modalities=("rgb", "event")):
    """Image, ring mask with its ellipse, marker mask and pose, a row per modality; and the estimates."""
    fig, axes = plt.subplots(len(modalities), 4, figsize=(10, 2.05 * len(modalities)), squeeze=False)
    answers = []
    for row, modality in zip(axes, modalities, strict=True):
        estimator = Estimator(recording.camera, modality=modality)
        t_us, image = list(images(recording, modality))[-3]
        answers.append(answer := estimator(image, t_us))
        title = "RGB frame" if modality == "rgb" else f"{image.sum():,} events"
        show_image(row[0], image, title)
        show_image(row[1], estimator.ring_filter(image), "ring filter, ellipse")
        draw_ellipse(row[1], answer.ellipse, COLOUR["event"])
        show_image(row[2], estimator.find_reflectors(image, answer.ellipse), "reflector filter")
        draw_estimate(row[3], image, answer, estimator.port, recording.camera)
        row[3].set_title("pose")
    return fig, answers


def draw_cumulative(ax, values, label: str, colour: str, **style) -> None:
    """Share of values below each value."""
    values = np.sort(np.asarray(values)[np.isfinite(values)])
    ax.plot(
        values, 100 * (np.arange(len(values)) + 1) / max(len(values), 1), color=colour, label=label, **style
    )


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


def mask_errors(found, truth) -> np.ndarray:
    """A picture (H, W, 3) of boolean masks: right green, too much orange, missed blue."""
    picture = np.zeros((*truth.shape, 3))
    for where, name in ((found & truth, "truth"), (found & ~truth, "event"), (~found & truth, "ours")):
        picture[where] = matplotlib.colors.to_rgb(COLOUR[name])
    return picture
