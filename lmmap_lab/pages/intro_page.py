"""Drawings of the book's first page: the way from an image to a pose.

``python -m lmmap_lab.pages.intro_page`` writes the picture that README shows, ``book/_static/steps.png``.
"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from lmmap.estimation.images import images
from lmmap.geometry.port import circle_points_m
from lmmap.pipeline import circle
from lmmap.pipeline.crops import mask_about
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.masks import markers_box_px
from lmmap.pipeline.ring import find_ring, skeleton_points
from lmmap.settings import OURS, PAPER
from lmmap.types import Camera, Ellipse, Estimate, Pose, Recording

from ..bench import laboratory, sequences
from ..provenance import ROOT
from ..studies.verdicts import ESTIMATORS
from .drawings import COLOUR, outlines_px, use_style
from .sliders import Step, Strip, broken
from .tables import rules, sentence_table

FRAME_MS = 358  # time in "test-medium" of the frame that the walk keeps to
AROUND = 4.5  # how much of an image is shown, in semi-major axes of the ring
REPRODUCE_MINUTES = 9  # of `make reproduce` on two cores, without the installation; README says the same
# what a step does, what it gives, and its colour: see `draw_flow`
FLOW = (
    (f"frame, or\n{PAPER.events_per_window:,} events", "image", "ink"), ("ring\nnetwork", "mask", "event"),
    ("skeleton,\nRANSAC", "ellipse", "rgb"), ("exact\ncircle", "two poses", "truth"),
    ("marker\nnetwork", "mask", "event"), ("correlation\nwith CAD", "pose", "rgb"),
    ("joint\nrefinement", "finer pose", "truth"), ("confidence", "reported pose", "truth"),
    ("outlier\nfilter", "trajectory", "rgb"),
)  # fmt: skip
IN_A_ROW = 3
HEADLINES = {  # claims of the paper by key, in short
    "alike_low_gap": "Trained on film, frames and events are similarly accurate",
    "events_win": "Trained without film, events beat frames in high light",
    "events_generalise": "Events generalise better than frames",
    "normal_poor": "The normal is far less accurate than the position",
    "sensitivity_explains": "A one-pixel error, which can turn the normal by 8.9°, explains this",
    "satellite_agnostic": "The method needs to know nothing about the satellite except its port",
    "data_efficient": "It is data-efficient",
    "lightweight": "It is lightweight",
    "slow_blinds_events": "Slow motion blinds the event camera",
    "reflect_blinds_frames": "A full reflection blinds the RGB camera",
    "false_detections": "Without a port, false poses are rare",
    "odometry_not_enough": "Visual odometry is not accurate enough to dock",
    "ten_hz": "It runs at 10 Hz",
}


def draw_flow():
    """Draw the pipeline as boxes: orange is learnt, blue is geometry, green is not in the paper."""
    rows = -(-len(FLOW) // IN_A_ROW)
    fig, ax = plt.subplots(figsize=(4.6, 1.2 * rows))  # narrow, so that a phone can show it
    arrow = {"arrowstyle": "->", "color": COLOUR["ink"], "shrinkA": 0}
    for k, (does, gives, colour) in enumerate(FLOW):
        x, y = k % IN_A_ROW, -1.3 * (k // IN_A_ROW)
        box = {"boxstyle": "round,pad=0.4", "fc": COLOUR[colour] + "30", "ec": COLOUR[colour], "lw": 1.5}
        ax.text(x, y, does, ha="center", va="center", fontsize=9.5, bbox=box)
        if k == len(FLOW) - 1:
            ax.annotate(gives, (x, y - 0.3), (x, y - 0.75), ha="center", fontsize=9, style="italic",
                        arrowprops={**arrow, "arrowstyle": "<-"})  # fmt: skip
        elif x == IN_A_ROW - 1:  # on to the row below
            turn = y - 0.65
            ax.plot([x, x, 0], [y - 0.3, turn, turn], color=COLOUR["ink"], lw=1)
            ax.annotate("", (0, y - 1), (0, turn), arrowprops=arrow)
            ax.text(x / 2, turn + 0.07, gives, ha="center", fontsize=9, style="italic")
        else:
            ax.annotate("", (x + 0.65, y), (x + 0.43, y), arrowprops=arrow)
            ax.text(x + 0.54, y + 0.08, gives.replace(" ", "\n"), ha="center", fontsize=9, style="italic")
    ax.set(xlim=(-0.5, IN_A_ROW - 0.5), ylim=(-1.3 * (rows - 1) - 0.85, 0.4))
    ax.set_label("the pipeline: " + ", ".join(f"{does} to {gives}" for does, gives, _ in FLOW))
    ax.set_axis_off()
    return fig


def scorecard(claims: pd.DataFrame):
    """Headline claims, a row each, styled: rule, numbers of the paper and of the estimator that decides, with
    its name, and verdict; ``claims`` as `claims.claims`."""
    rows = claims.set_index("key").loc[list(HEADLINES)]
    columns = {name: estimator for estimator, name in ESTIMATORS.items()}
    here = [f"{row[columns[row.decides]]}<br><small>{row.decides}</small>" for _, row in rows.iterrows()]
    table = pd.DataFrame({
        "claim": rows.index.map(HEADLINES) + rules(rows),
        "paper": rows.paper, "here": here, "verdict": "<b>" + rows.verdict + "</b>",
    })  # fmt: skip
    return sentence_table(table.map(lambda text: text.replace(" | ", " and ")), "sentences claims")


def clean_pictures(found: pd.DataFrame, pictures: pd.DataFrame) -> pd.DataFrame:
    """What the default networks find in pictures of the real port that show its ring and have nothing drawn
    in; ``found`` as data/results/pictures.csv, ``pictures`` as data/paper/pictures.csv."""
    seen = pictures[
        ~pictures.lines & ~pictures.note.str.startswith("nobody") & (pictures.picture != "port-drawing")
    ]
    ours = found[(found.filters == OURS.weights) & found.local_search]
    return ours[ours.picture.isin(seen.picture)]


def shown_pose() -> Pose:
    """True pose of the port in the frame of the book's first figure."""
    return laboratory.sequence_motion(laboratory.sequence("test-medium"), np.array([1e-3 * FRAME_MS]))[0]


def walk(recording: Recording) -> tuple[list[Step], Estimate]:
    """What the pipeline makes of a recording's last frame, step by step, and its estimate."""
    camera, estimator = recording.camera, Estimator(recording.camera)
    port, setup = estimator.port, estimator.setup
    t_us, image = list(images(recording, "rgb"))[-1]
    mask, answer = estimator.ring_network(image), estimator(image, t_us)
    ring = find_ring(mask, setup).ellipse
    pair = circle.poses(ring, camera, port.ring_radius_m)
    markers = mask_about(estimator.reflector_network, image, *markers_box_px(pair, port, camera))
    rows, columns = _around(ring, camera)
    corner_px = np.array([columns.start, rows.start])

    def step(label, title, picture, *curves):
        moved = tuple((name, points - corner_px, colour, mode) for name, points, colour, mode in curves)
        return Step(label, title, picture[rows, columns], moved)

    frame = image / 255
    contour = ("ellipse", ring.points(181), "event", "lines")
    sheet = np.full(frame[rows, columns].shape[:2], 0.96)
    space = Step("two normals", "Two circles in space (blue and ochre, with their normals) have this image.",
                 sheet, _in_space(pair, port.ring_radius_m, sheet.shape))  # fmt: skip
    steps = [
        step("image", "A frame from the simulation.", frame),
        step("mask", "A network marks the ring.", mask),
        step("skeleton", "The mask is thinned to a line (orange).", 0.4 * mask,
             ("skeleton", skeleton_points(mask), "event", "markers")),
        step("ellipse", "RANSAC fits an ellipse (orange).", frame, contour),
        space,
        step("markers", "A second network finds the markers, which select one circle and give the yaw.",
             markers),
        step("pose", "The pose of the port, drawn as its outline (orange).", frame,
             ("pose", broken(outlines_px(answer.T_cam_port, port, camera)), "event", "lines")),
    ]  # fmt: skip
    return steps, answer


def _in_space(pair: Pose, radius_m: float, size_px) -> tuple:
    """Curves of both circles and normals, and of the lines of sight, seen obliquely; the camera is left."""
    sight = pair.position_m.mean(0) / np.linalg.norm(pair.position_m.mean(0))
    lean = np.diff(pair.normal, axis=0)[0]
    lean = (lean - lean @ sight * sight) / np.linalg.norm(lean - lean @ sight * sight)
    view = np.column_stack([sight + 0.4 * np.cross(sight, lean), lean + 0.25 * np.cross(sight, lean)])
    scale, centre = 1.3 * size_px[1] / (8 * radius_m), [0.6 * size_px[1], 0.5 * size_px[0]]

    def flat(points_m):
        return (np.asarray(points_m) - pair.position_m.mean(0)) @ view * scale + centre

    circles_m = [T @ circle_points_m(radius_m, 73) for T in pair]
    ends = circles_m[0][::9]
    rays = broken(flat([0.7 * x, x]) for x in ends)
    arrows = [flat([T.position_m, T.position_m + 1.6 * radius_m * T.normal]) for T in pair]
    shapes = [broken([flat(np.vstack([c, c[:1]])), arrow])
              for c, arrow in zip(circles_m, arrows, strict=True)]  # fmt: skip
    return (("lines of sight", rays, "ink", "lines"), ("one circle", shapes[0], "rgb", "lines"),
            ("the other", shapes[1], "rival", "lines"))  # fmt: skip


def _around(ellipse: Ellipse, camera: Camera) -> tuple[slice, slice]:
    """Rows and columns of the part of the image around an ellipse."""
    tall = min(round(AROUND * ellipse.semi_axes_px[0]), camera.height_px)
    wide = min(4 * tall // 3, camera.width_px)
    corner = np.clip(ellipse.centre_px - [wide / 2, tall / 2], 0, camera.size_px - np.array([wide, tall]))
    left, top = corner.astype(int)
    return slice(top, top + tall), slice(left, left + wide)


if __name__ == "__main__":
    use_style()
    plt.rcParams.update({"savefig.transparent": False, "savefig.facecolor": "white"})
    still = Strip(walk(sequences.simulate("test-medium", 0.4))[0], "step").still()
    (ROOT / "book" / "_static" / "steps.png").write_bytes(still)
