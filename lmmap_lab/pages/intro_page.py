"""Drawings of the book's first page: the way from an image to a pose."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from lmmap.estimation.images import images
from lmmap.pipeline.estimator import Estimator
from lmmap.settings import MODALITIES, OURS, PAPER
from lmmap.types import Camera, Ellipse, Recording

from ..studies.verdicts import ESTIMATORS
from .drawings import COLOUR, draw_estimate
from .port_fit import draw_outline
from .tables import rules, sentence_table

AROUND = 4.5  # how much of an image is shown, in semi-major axes of the ring
REPRODUCE_MINUTES = 9  # of `make reproduce` on two cores, without the installation; README says the same
# what a step does, what it gives, and its colour: see `draw_flow`
FLOW = (
    (f"frame, or\n{PAPER.events_per_window:,} events", "image", "ink"), ("ring\nnetwork", "mask", "event"),
    ("skeleton,\nRANSAC", "ellipse", "rgb"), ("exact\ncircle", "two poses", "truth"),
    ("marker\nnetwork", "mask", "event"), ("correlation\nwith CAD", "pose", "rgb"),
    ("joint\nrefinement", "finer pose", "truth"), ("confidence", "sure pose", "truth"),
    ("outlier\nfilter", "trajectory", "rgb"),
)  # fmt: skip
IN_A_ROW = 5
HEADLINES = {  # claims of the paper by key, in short
    "alike_low_gap": "Trained on film, frames and events are similarly accurate",
    "events_win": "Trained without film, events beat frames in high light",
    "events_generalise": "Events generalise better than frames",
    "normal_poor": "The normal is far less accurate than the position",
    "sensitivity_explains": "because one pixel can turn it by 8.9°",
    "satellite_agnostic": "It works knowing nothing of the satellite but the port",
    "slow_blinds_events": "Slow motion blinds the event camera",
    "reflect_blinds_frames": "A full reflection blinds the RGB camera",
    "false_detections": "Without a port, false poses are rare",
    "odometry_not_enough": "Visual odometry is not accurate enough to dock",
    "ten_hz": "It runs at 10 Hz",
}


def draw_flow():
    """Draw the pipeline as boxes: orange is learnt, blue is geometry, green is not in the paper."""
    fig, ax = plt.subplots(figsize=(7.6, 2.6))
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
    return fig


def scorecard(claims: pd.DataFrame):
    """Headline claims, a row each, styled: rule, numbers of the paper and of the estimator that decides, and
    verdict; ``claims`` as `claims.claims`."""
    rows = claims.set_index("key").loc[list(HEADLINES)]
    columns = {name: estimator for estimator, name in ESTIMATORS.items()}
    ours = [row[columns[row.decides]] for _, row in rows.iterrows()]
    numbers = ("Numbers: " + rows.numbers + ". ").mask(rows.numbers == "in words", "")
    table = pd.DataFrame({
        "claim": rows.index.map(HEADLINES) + rules(rows, numbers), "paper": rows.paper, "here": ours,
        "verdict": "<b>" + rows.verdict + "</b>",
    })  # fmt: skip
    return sentence_table(table.map(lambda text: text.replace(" | ", " and ")))


def clean_pictures(found: pd.DataFrame, pictures: pd.DataFrame) -> pd.DataFrame:
    """What the default networks find in pictures of the real port that show its ring and have nothing drawn
    in; ``found`` as data/results/pictures.csv, ``pictures`` as data/paper/pictures.csv."""
    seen = pictures[
        ~pictures.lines & ~pictures.note.str.startswith("nobody") & (pictures.picture != "port-drawing")
    ]
    ours = found[(found.filters == OURS.weights) & found.local_search]
    return ours[ours.picture.isin(seen.picture)]


def draw_first(recording: Recording, outlines):
    """Draw the last frame and histogram of a recording with the pose in each, and the real port's lines.

    Parameters
    ----------
    outlines
        By picture, those of data/results/port-outlines.json.

    Returns
    -------
    tuple
        The figure and the list of estimates.
    """
    fig, axes = plt.subplots(1, 3, figsize=(7.6, 2.2))
    answers = []
    for ax, modality, title in zip(axes, MODALITIES, ("a frame", "events"), strict=False):
        estimator = Estimator(recording.camera, modality=modality)
        t_us, image = list(images(recording, modality))[-1]
        answers.append(answer := estimator(image, t_us))
        draw_estimate(ax, image, answer, estimator.port, recording.camera)
        ax.set_title(title)
        _look_at(ax, answer.ellipse, recording.camera)
    draw_outline(axes[2], outlines["rgb-estimate-overlaid"])
    axes[2].set_title("the real port, outlines")
    return fig, answers


def _look_at(ax, ellipse: Ellipse, camera: Camera) -> None:
    """Let axes show the part of the image around an ellipse."""
    tall = min(AROUND * ellipse.semi_axes_px[0], camera.height_px)
    wide = min(4 / 3 * tall, camera.width_px)
    left, top = np.clip(ellipse.centre_px - [wide / 2, tall / 2], 0, camera.size_px - np.array([wide, tall]))
    ax.set(xlim=(left - 0.5, left + wide - 0.5), ylim=(top + tall - 0.5, top - 0.5))
