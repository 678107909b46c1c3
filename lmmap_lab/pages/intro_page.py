"""Drawings of the book's first page: the way from an image to a pose."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np

from lmmap.estimation.images import images
from lmmap.pipeline.circle import candidates
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.masks import reflector_mask
from lmmap.settings import PAPER
from lmmap.types import Camera, Ellipse, Recording

from .drawings import COLOUR, draw_ellipse, draw_estimate, show_image

AROUND = 4.5  # how much of an image is shown, in semi-major axes of the ring
REPRODUCE_MINUTES = 12  # of `make reproduce` on two cores, without the installation; README says the same
# what a step does, what it gives, and its colour: see `draw_flow`
FLOW = (
    (f"frame, or\n{PAPER.events_per_window:,} events", "image", "ink"), ("ring\nnetwork", "mask", "event"),
    ("skeleton,\nRANSAC", "ellipse", "rgb"), ("exact\ncircle", "two poses", "truth"),
    ("marker\nnetwork", "mask", "event"), ("correlation\nwith CAD", "pose", "rgb"),
    ("joint\nrefinement", "finer pose", "truth"), ("confidence", "sure pose", "truth"),
    ("outlier\nfilter", "trajectory", "rgb"),
)  # fmt: skip
IN_A_ROW = 5


def draw_flow(ax) -> None:
    """Draw the pipeline as boxes: orange is learnt, blue is geometry, green is not in the paper."""
    arrow = {"arrowstyle": "->", "color": COLOUR["ink"], "shrinkA": 0}
    for k, (does, gives, colour) in enumerate(FLOW):
        x, y = k % IN_A_ROW, -1.3 * (k // IN_A_ROW)
        box = {"boxstyle": "round,pad=0.4", "fc": COLOUR[colour] + "30", "ec": COLOUR[colour], "lw": 1.5}
        ax.text(x, y, does, ha="center", va="center", fontsize=8.5, bbox=box)
        if x == IN_A_ROW - 1:  # on to the row below
            turn = y - 0.65
            ax.plot([x, x, 0], [y - 0.3, turn, turn], color=COLOUR["ink"], lw=1)
            ax.annotate("", (0, y - 1), (0, turn), arrowprops=arrow)
            ax.text(x / 2, turn + 0.12, gives, ha="center", fontsize=8, style="italic")
        else:
            ax.annotate("", (x + 0.62, y), (x + 0.38, y), arrowprops=arrow)
            ax.text(x + 0.5, y - 0.32, gives, ha="center", va="center", fontsize=8, style="italic")
    ax.set(xlim=(-0.5, IN_A_ROW - 0.45), ylim=(-1.75, 0.4))
    ax.set_label("the pipeline: " + ", ".join(f"{does} to {gives}" for does, gives, _ in FLOW))
    ax.set_axis_off()


def draw_pipeline(recording: Recording, modalities=("rgb", "event")):
    """Draw image, ring mask with its ellipse, marker mask and pose, a row per modality, around the ring.

    Returns
    -------
    tuple
        The figure and the list of estimates.
    """
    fig, axes = plt.subplots(len(modalities), 4, figsize=(7.6, 1.65 * len(modalities)), squeeze=False)
    answers = []
    for row, modality in zip(axes, modalities, strict=True):
        estimator = Estimator(recording.camera, modality=modality)
        t_us, image = list(images(recording, modality))[-3]
        answers.append(answer := estimator(image, t_us))
        title = "RGB frame" if modality == "rgb" else f"{image.sum():,} events"
        show_image(row[0], image, title)
        show_image(row[1], estimator.ring_network(image), "ring filter, ellipse")
        if answer.ellipse is not None:
            draw_ellipse(row[1], answer.ellipse, COLOUR["event"])
            circles = candidates(answer.ellipse, recording.camera, estimator.port.ring_radius_m)
            network = estimator.reflector_network
            markers = reflector_mask(network, image, circles, estimator.port, recording.camera)
            show_image(row[2], markers, "marker filter")
        draw_estimate(row[3], image, answer, estimator.port, recording.camera)
        row[3].set_title("pose")
        if answer.ellipse is not None:
            _look_at(row, answer.ellipse, recording.camera)
    return fig, answers


def _look_at(axes, ellipse: Ellipse, camera: Camera) -> None:
    """Let axes show the part of the image around an ellipse."""
    tall = min(AROUND * ellipse.semi_axes_px[0], camera.height_px)
    wide = min(4 / 3 * tall, camera.width_px)
    left, top = np.clip(ellipse.centre_px - [wide / 2, tall / 2], 0, camera.size_px - np.array([wide, tall]))
    for ax in axes:
        ax.set(xlim=(left - 0.5, left + wide - 0.5), ylim=(top + tall - 0.5, top - 0.5))
