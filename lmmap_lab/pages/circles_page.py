"""The interactive ring of the chapter on circles, and its drawings."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from io import BytesIO

import matplotlib.pyplot as plt
import numpy as np
from scipy.spatial.transform import Rotation

from lmmap.geometry.conics import circle_ellipse
from lmmap.geometry.projection import project
from lmmap.pipeline import circle
from lmmap.types import Camera, Pose

from ..provenance import ROOT
from .drawings import COLOUR, draw_ellipse

SCRIPT = ROOT / "book" / "_static" / "ring-lab.js"  # tests/check_book.py holds it to `lmmap.geometry`
START_TILT_DEG, START_DISTANCE_M = 35.0, 0.35  # where the script begins, and what the still shows


class RingLab:
    """The interactive ring as the output of a notebook's cell, with a still of its start for print.

    Parameters
    ----------
    medians_deg
        The printed formula's median error over the test's poses by the lens in mm.
    band_deg : the least and the largest median of Table I
    """

    def __init__(self, radius_m: float, camera: Camera, medians_deg: Mapping[float, float],
                 band_deg: tuple[float, float]):  # fmt: skip
        self.radius_m, self.camera = radius_m, camera
        self.facts = {"medians": [[lens, round(deg, 2)] for lens, deg in medians_deg.items()],
                      "band": [round(deg, 1) for deg in band_deg]}  # fmt: skip

    def _repr_mimebundle_(self, include=None, exclude=None) -> dict:
        facts = json.dumps(self.facts)
        html = f"<div class='ring-lab' data-table='{facts}'></div><script>{SCRIPT.read_text()}</script>"
        return {"text/html": html, "image/png": self.still()}

    def still(self) -> str:
        """The first view as a PNG in base64."""
        fig, (beside, image) = plt.subplots(1, 2, figsize=(7.6, 3.2))
        turn = Rotation.from_rotvec([np.deg2rad(START_TILT_DEG), 0, 0]) * Rotation.from_rotvec([np.pi, 0, 0])
        truth = Pose(turn.as_matrix(), [0, 0, START_DISTANCE_M])
        draw_meridian(beside, truth, self.radius_m, self.camera)
        draw_centres(image, truth, self.radius_m, self.camera)
        file = BytesIO()
        fig.savefig(file, format="png", metadata={"Description": "the ring, its twin and the printed circle"})
        plt.close(fig)
        return base64.b64encode(file.getvalue()).decode()


def nearest(poses: Pose, truth: Pose) -> int:
    """Which of two poses has the normal nearer to the true one."""
    return int(np.argmax(poses.normal @ truth.normal))


def draw_meridian(ax, truth: Pose, radius_m: float, camera: Camera) -> None:
    """Section through the optical axis of a ring on it, tilted about the camera's x axis.

    Two lines of sight bound the ring.  The ring, its twin and the printed circle are segments with normals.
    """
    contour = circle_ellipse(truth, radius_m, camera)
    pair, printed = circle.poses(contour, camera, radius_m), circle.paper_poses(contour, camera, radius_m)
    k, j = nearest(pair, truth), nearest(printed, truth)
    ends_m = truth @ (radius_m * np.array([[0.0, 1, 0], [0, -1, 0]]))
    reach_m = np.max([np.abs(T.position_m[1:]) for T in (truth, pair[1 - k], printed[j])], 0) + radius_m
    half_m, far_m = 1.05 * reach_m
    for end in ends_m:
        ax.plot([0, far_m], [0, far_m * end[1] / end[2]], color=COLOUR["ink"], lw=0.8)
    rows = (truth, "truth", "the ring", "-"), (pair[1 - k], "rival", "its twin", "-"), (
        printed[j], "paper", "printed formula", "--")  # fmt: skip
    for T, colour, name, style in rows:
        along = np.array([0.0, T.normal[2], -T.normal[1]])
        segment = T.position_m + radius_m * np.array([[-1], [1]]) * along / np.linalg.norm(along)
        ax.plot(segment[:, 2], segment[:, 1], style, color=COLOUR[colour], lw=2.2, label=name)
        tip = T.position_m + 0.5 * radius_m * T.normal
        arrow = {"arrowstyle": "->", "color": COLOUR[colour], "ls": style, "lw": 1.5}
        ax.annotate("", tip[[2, 1]], T.position_m[[2, 1]], arrowprops=arrow)
    ax.plot(0, 0, "s", color=COLOUR["ink"], ms=7)
    ax.annotate("camera", (0, 0), (0.004, 0.03), fontsize=9)
    ax.set(aspect="equal", xlabel="depth (m)", ylabel="y (m)", xlim=(-0.02, far_m), ylim=(half_m, -half_m))
    ax.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=3, fontsize=9)


def draw_centres(ax, truth: Pose, radius_m: float, camera: Camera) -> None:
    """A ring's image: its ellipse with both axes, and the two centres, the ellipse's and the ring's."""
    seen = circle_ellipse(truth, radius_m, camera)
    draw_ellipse(ax, seen, COLOUR["ink"], lw=1.5)
    c, s = np.cos(seen.angle_rad), np.sin(seen.angle_rad)
    for half_px, direction in zip(seen.semi_axes_px, np.array([[c, s], [-s, c]]), strict=True):
        u, v = (seen.centre_px + half_px * np.array([[-1], [1]]) * direction).T
        ax.plot(u, v, ":", color=COLOUR["ink"], lw=0.8)
    ax.plot(*seen.centre_px, "x", color=COLOUR["paper"], ms=10, mew=2.5, label="centre of the ellipse")
    ax.plot(*project(truth.position_m, camera), "o", color=COLOUR["truth"], label="centre of the ring")
    ax.set(
        aspect="equal",
        xlim=(0, camera.width_px),
        ylim=(camera.height_px, 0),
        xlabel="u (px)",
        ylabel="v (px)",
    )
    ax.legend(loc="lower right", fontsize=8)
