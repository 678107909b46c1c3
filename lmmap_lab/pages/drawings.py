"""The style of figures, colours by their meaning, and the drawings that several chapters share."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import cycler
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import LogLocator, NullFormatter
from pandas.io.formats.style import Styler

from lmmap.geometry.port import circle_points_m
from lmmap.geometry.projection import project
from lmmap.types import Camera, Ellipse, Estimate, Port, Pose

from . import tables

# Colours that colour-blind readers tell apart, after Okabe & Ito, and dark enough for lines on white: 3:1 at
# least.  The ink is nearly black: the dark page inverts drawings, and puts pictures on a light sheet
# (book/_static/custom.css).
COLOUR = {"rgb": "#0072B2", "event": "#D55E00", "fused": "#009E73", "truth": "#009E73", "paper": "#C46BA0",
          "ours": "#2A93CC", "rival": "#B97F00", "ink": "#333333"}  # fmt: skip

LINES = ("rgb", "event", "truth", "paper", "rival")


def use_style() -> None:
    """Transparent figures with dark ink; the dark page inverts them."""
    _register()
    ink = COLOUR["ink"]
    matplotlib.rcParams.update({
        "figure.facecolor": "none", "axes.facecolor": "none", "savefig.facecolor": "none",
        "savefig.transparent": True, "figure.dpi": 110, "figure.constrained_layout.use": True,
        "figure.figsize": (7.0, 3.2), "font.size": 10, "text.color": ink, "axes.labelcolor": ink,
        "axes.edgecolor": ink, "axes.titlecolor": ink, "xtick.color": ink, "ytick.color": ink,
        "axes.grid": True, "axes.axisbelow": True, "grid.alpha": 0.25, "grid.color": ink,
        "axes.spines.top": False, "axes.spines.right": False, "legend.facecolor": "white",
        "legend.edgecolor": "none", "legend.framealpha": 0.85,
        "image.cmap": "gray", "svg.hashsalt": "lmmap",
        "axes.prop_cycle": cycler.cycler(color=[COLOUR[k] for k in LINES]),
    })  # fmt: skip


def describe(fig) -> str:
    """A figure in words, for readers who cannot see it: the titles, labels and legends of its axes.

    Axes without any of these are described by their own label, which ``set_label`` sets.
    """
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
    """In a notebook, write each figure's description into its PNG file, and styled tables with equal bytes.

    The book's pages take a figure's alternative text from there, and learn whether it has a picture in it,
    which the dark page must not invert.
    """
    from IPython import get_ipython
    from IPython.core.pylabtools import print_figure

    if shell := get_ipython():
        plt.switch_backend(matplotlib.get_backend())  # now, or its own formatter would come after ours
        formatters = shell.display_formatter.formatters
        formatters["image/png"].for_type(
            plt.Figure, lambda fig: print_figure(fig, "png", base64=True, metadata=_metadata(fig))
        )
        formatters["text/html"].for_type(Styler, tables.to_html)
        formatters["text/plain"].for_type(
            Styler, lambda table, printer, _: printer.text(tables.to_text(table))
        )


def _metadata(fig) -> dict[str, str]:
    kind = "picture" if any(ax.images for ax in fig.axes) else "drawing"
    return {"Description": describe(fig), "Comment": kind}


def show_image(ax, image, title: str = "") -> None:
    """Show an RGB frame, a mask, or a histogram, whose counts saturate at the 99.5th percentile."""
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
    """Draw the CAD model's ring and markers at a pose on an image."""
    for line_px in outlines_px(T_cam_port, port, camera):
        ax.plot(*line_px.T, color=colour, lw=style.get("lw", 1.0))


def outlines_px(T_cam_port: Pose, port: Port, camera: Camera, radii_m: Sequence[float] | None = None):
    """Closed lines (M, 2): circles of these radii, by default the ring's edges, and the markers."""
    radii_m = (port.ring_inner_radius_m, port.ring_outer_radius_m) if radii_m is None else radii_m
    shapes_m = [*(circle_points_m(r, 90) for r in radii_m), *port.marker_corners_m()]
    return [project(T_cam_port @ np.vstack([s, s[:1]]), camera) for s in shapes_m]


def draw_ellipse(ax, ellipse: Ellipse, colour: str = COLOUR["ours"], **style) -> None:
    """Draw an ellipse's contour on an image."""
    u, v = ellipse.points(180).T
    ax.plot(np.append(u, u[0]), np.append(v, v[0]), color=colour, **{"lw": 1.0, **style})


def draw_estimate(
    ax, image, estimate: Estimate, port: Port, camera: Camera, truth: Pose | None = None
) -> None:
    """Show an image, and draw the estimate and, if it is given, the true pose on it."""
    show_image(ax, image, str(estimate.status))
    if truth is not None:
        draw_port(ax, truth, port, camera, COLOUR["truth"])
    if estimate.T_cam_port is not None:
        draw_port(ax, estimate.T_cam_port, port, camera, COLOUR["event"])
    ax.set_xlim(-0.5, camera.width_px - 0.5)
    ax.set_ylim(camera.height_px - 0.5, -0.5)


def draw_intervals(ax, x, value, low, high, colour: str, label: str) -> None:
    """Draw dots (N,) over ``x``, each with a bar from the low to the high end of its interval."""
    ax.errorbar(x, value, np.abs([value - low, high - value]), fmt="o", ms=4, capsize=3, color=colour,
                label=label)  # fmt: skip


def look_at(ax, ring: Ellipse, semi_axes: float) -> float:
    """Bound axes to a square about a ring, of so many semi-major axes to each side; returns the same in
    pixels."""
    (u, v), half_px = ring.centre_px, semi_axes * ring.semi_axes_px[0]
    ax.set(xlim=(u - half_px, u + half_px), ylim=(v + half_px, v - half_px))
    return half_px


def plain_log(axis, steps: tuple[int, ...] = (1, 2, 5)) -> None:
    """Let a logarithmic axis (``ax.xaxis`` or ``ax.yaxis``) have ticks at these steps, in plain numbers."""
    axis.set_major_locator(LogLocator(subs=steps))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def draw_cumulative(ax, values, label: str, colour: str, **style) -> None:
    """Draw the share of values below each value, in percent; values that are not finite do not count."""
    values = np.sort(np.asarray(values)[np.isfinite(values)])
    ax.plot(
        values, 100 * (np.arange(len(values)) + 1) / max(len(values), 1), color=colour, label=label, **style
    )
