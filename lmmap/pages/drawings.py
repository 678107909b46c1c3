"""Figures: one style, colours by meaning, and the few drawings that chapters share."""

from __future__ import annotations

from collections import Counter

import cycler
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from pandas.io.formats.style import Styler

from ..geometry.projection import circle_points_m, project
from ..pipeline.estimator import Estimator
from ..pipeline.run import images
from ..types import Camera, Ellipse, Estimate, Port, Pose, Recording
from . import tables

# colours that colour-blind readers tell apart (after Okabe & Ito), readable on light and dark
COLOUR = {"rgb": "#0072B2", "event": "#D55E00", "fused": "#009E73", "truth": "#009E73", "paper": "#CC79A7",
          "ours": "#56B4E9", "rival": "#E69F00", "ink": "#7C7C7C"}  # fmt: skip

LINES = ("rgb", "event", "truth", "paper", "rival")


def use_style() -> None:
    """Transparent figures with grey ink, so that light and dark pages can both carry them."""
    _register()
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


def describe(fig) -> str:
    """A figure in words, for who does not see it: its axes' titles, labels and legends; where there are none,
    what ``set_label`` has said."""
    texts = []
    for ax in fig.axes:
        labels = [text for text in (ax.get_ylabel(), ax.get_xlabel()) if text]
        lines = [text.get_text() for text in ax.get_legend().get_texts()] if ax.get_legend() else []
        what = "image" if ax.images else " over ".join(labels) or ax.get_label() or "drawing"
        texts.append(
            f"{ax.get_title()}: {what}".removeprefix(": ") + (f" ({', '.join(lines)})" if lines else "")
        )
    counts = Counter(" ".join(text.split()) for text in texts)
    return "; ".join(f"{n} times {text}" if n > 1 else text for text, n in counts.items())


def _register() -> None:
    """In a notebook, write each figure's description into its PNG file, where the book's pages find it, and
    styled tables alike each time."""
    from IPython import get_ipython
    from IPython.core.pylabtools import print_figure

    if shell := get_ipython():
        plt.switch_backend(matplotlib.get_backend())  # now, or its own formatter would come after ours
        formatters = shell.display_formatter.formatters
        formatters["image/png"].for_type(
            plt.Figure,
            lambda fig: print_figure(fig, "png", base64=True, metadata={"Description": describe(fig)}),
        )
        formatters["text/html"].for_type(Styler, tables.html)
        formatters["text/plain"].for_type(Styler, lambda table, printer, _: printer.text(tables.text(table)))


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
    """An ellipse's contour, on an image."""
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
    fig, axes = plt.subplots(len(modalities), 4, figsize=(7.6, 1.65 * len(modalities)), squeeze=False)
    answers = []
    for row, modality in zip(axes, modalities, strict=True):
        estimator = Estimator(recording.camera, modality=modality)
        t_us, image = list(images(recording, modality))[-3]
        answers.append(answer := estimator(image, t_us))
        title = "RGB frame" if modality == "rgb" else f"{image.sum():,} events"
        show_image(row[0], image, title)
        show_image(row[1], estimator.ring_filter(image), "ring filter, ellipse")
        if answer.ellipse is not None:
            draw_ellipse(row[1], answer.ellipse, COLOUR["event"])
            markers = estimator.find_reflectors(image, estimator.candidates(answer.ellipse))
            show_image(row[2], markers, "reflector filter")
        draw_estimate(row[3], image, answer, estimator.port, recording.camera)
        row[3].set_title("pose")
    return fig, answers


def draw_cumulative(ax, values, label: str, colour: str, **style) -> None:
    """Share of values below each value."""
    values = np.sort(np.asarray(values)[np.isfinite(values)])
    ax.plot(
        values, 100 * (np.arange(len(values)) + 1) / max(len(values), 1), color=colour, label=label, **style
    )


METHOD_COLOUR = {"ORB-SLAM3 event": "#E69F00", "ORB-SLAM3 rgb": "#56B4E9", "lmmap event": COLOUR["event"],
                 "lmmap rgb": COLOUR["rgb"], "SVO event": "#CC79A7", "SVO rgb": "#009E73"}  # fmt: skip


def draw_boxes(ax, groups: dict[str, list[np.ndarray]], ticks: list[str]) -> None:
    """Box plots side by side over shared ticks: ``groups[method][k]`` are the values at tick k.

    Boxes hold the middle half, whiskers reach to the last value within one and a half box lengths.
    """
    width = 0.8 / max(len(groups), 1)
    for row, (name, values) in enumerate(groups.items()):
        ink = {"color": METHOD_COLOUR[name]}
        some = [(k + (row - (len(groups) - 1) / 2) * width, v) for k, v in enumerate(values) if len(v)]
        if some:
            ax.boxplot([v for _, v in some], positions=[at for at, _ in some], widths=0.8 * width,
                       whiskerprops=ink, capprops=ink, medianprops=ink, showfliers=False,
                       manage_ticks=False, patch_artist=True,
                       boxprops={"facecolor": ink["color"] + "60", "edgecolor": ink["color"]})  # fmt: skip
        ax.plot([], [], color=ink["color"], linewidth=6, alpha=0.6, label=name)
    ax.set_xticks(range(len(ticks)), ticks)
    ax.set_xlim(-0.6, len(ticks) - 0.4)


def draw_tracked(ax, times_s: dict[str, list[np.ndarray]], gap_s: float = 0.3) -> None:
    """A thin line per run, drawn where it has poses: ``times_s[method][run]``."""
    rows, at = [], 0
    for name, runs in times_s.items():
        rows.append(at + (len(runs) - 1) / 2)
        for t_s in runs:
            breaks = np.flatnonzero(np.diff(t_s) > gap_s) + 1
            for part in np.split(t_s, breaks):
                if len(part):
                    ax.plot(part[[0, -1]], [at, at], color=METHOD_COLOUR[name], solid_capstyle="butt")
            at += 1
        at += 2
    ax.set_yticks(rows, list(times_s))
    ax.set_ylim(at - 1, -1)  # not inverted, which two axes that share it would undo
    ax.grid(axis="y", visible=False)


def mask_errors(found, truth) -> np.ndarray:
    """A picture (H, W, 3) of boolean masks: right green, too much orange, missed blue."""
    picture = np.zeros((*truth.shape, 3))
    for where, name in ((found & truth, "truth"), (found & ~truth, "event"), (~found & truth, "ours")):
        picture[where] = matplotlib.colors.to_rgb(COLOUR[name])
    return picture
