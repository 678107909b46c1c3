"""Where a person sees the ring in another laboratory, and the default networks give no right pose.

    python tuning/judge_missed.py

The images are those of the set "other laboratory, judged once" of `judged_images`.  A person looked at all
of them before any network did, on sheets with ticks at the ring's true place, and wrote into
`tuning/rings-seen.csv` whether the ring's outline can be followed on more than half of its length.  A ring
with a right pose counts as seen.  Images that nobody has judged yet, as after a change of the bench, are
drawn into data/derived/missed, and the script ends; it is called again when they are in the file.  The
table of seen rings and right poses goes to data/results/missed-elsewhere.csv, and pictures of images that a
person can read and the estimator cannot to data/results/missed-elsewhere.jpg.
"""

from __future__ import annotations

import sys
from pathlib import Path

import judged_images
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import wrong_poses
from choose_thresholds import right

from lmmap.geometry.conics import circle_ellipse
from lmmap.settings import OURS
from lmmap.types import Ellipse, Estimate, Pose
from lmmap_lab.pages import drawings
from lmmap_lab.pages.gallery import COLUMNS, DPI, TILE_IN
from lmmap_lab.pages.tables import ANSWERS, CAMERAS, LIGHTS
from lmmap_lab.provenance import DATA, DERIVED_DATA, save_table

SET = "other laboratory, judged once"
SEEN = Path(__file__).with_name("rings-seen.csv")
TABLE, PICTURE = (DATA / "results" / f"missed-elsewhere.{ending}" for ending in ("csv", "jpg"))
TO_JUDGE = DERIVED_DATA / "missed"
KEY = ["sequence", "modality", "image"]
SHOWN = 10
MARGIN = 1.6  # of a cut-out, in semi-major axes of the ring
SHEET = 12  # images of a sheet to judge


def answers() -> pd.DataFrame:
    """A row for each image: its key and light, pixels and truth, the estimate, and whether it is right."""
    rows = []
    for modality in ("rgb", "event"):
        estimator, number, last = wrong_poses.OnMasks(modality, OURS), 0, ""
        for case in judged_images.cases(SET, modality, OURS.weights):
            number, last = (number + 1 if case.name == last else 0), case.name
            estimate, look = estimator.answer(case)
            T = estimate.T_cam_port
            rows.append({"sequence": case.name, "modality": modality, "image": number, "light": case.light,
                         "pixels": case.looks[0].image, "truth": case.looks[0].truth, "estimate": estimate,
                         "right": T is not None and right(T, look.truth, judged_images.PORT)})  # fmt: skip
    return pd.DataFrame(rows)


def ring_at(truth: Pose) -> Ellipse:
    """The ring's centre line at a pose."""
    return circle_ellipse(truth, judged_images.PORT.ring_radius_m, judged_images.CAMERA)


def draw_to_judge(rows: pd.DataFrame) -> list[Path]:
    """Sheets of images cut out around the ring, whose place four ticks show."""
    TO_JUDGE.mkdir(parents=True, exist_ok=True)
    files = []
    for first in range(0, len(rows), SHEET):
        fig, axes = plt.subplots(3, 4, figsize=(16, 12.5))
        for ax in axes.flat:
            ax.set_axis_off()
        for ax, row in zip(axes.flat, rows.iloc[first : first + SHEET].itertuples(), strict=False):
            drawings.show_image(ax, row.pixels, f"{row.sequence} {row.modality} {row.image}")
            ring = ring_at(row.truth)
            (u, v), half_px = ring.centre_px, drawings.look_at(ax, ring, MARGIN)
            for span in half_px * np.array([[-1, -0.85], [0.85, 1]]):
                ax.plot(u + span, [v, v], color=drawings.COLOUR["truth"], lw=1)
                ax.plot([u, u], v + span, color=drawings.COLOUR["truth"], lw=1)
        files.append(TO_JUDGE / f"{first // SHEET:02d}.png")
        fig.savefig(files[-1], dpi=80, facecolor="white")
        plt.close(fig)
    return files


def draw_missed(rows: pd.DataFrame) -> None:
    """A sheet of cut-outs, the true ring green and the ellipse, where one was found, blue."""
    height = -(-len(rows) // COLUMNS)
    fig, axes = plt.subplots(height, COLUMNS, figsize=(TILE_IN * COLUMNS, TILE_IN * height), squeeze=False)
    for ax in axes.flat:
        ax.set_axis_off()
    for ax, row in zip(axes.flat, rows.itertuples(), strict=False):
        estimate: Estimate = row.estimate
        drawings.draw_estimate(ax, row.pixels, estimate, judged_images.PORT, judged_images.CAMERA, row.truth)
        if estimate.T_cam_port is None and estimate.ellipse is not None:
            drawings.draw_ellipse(ax, estimate.ellipse)
        drawings.look_at(ax, ring_at(row.truth), MARGIN)
        said = ANSWERS[str(estimate.status)] if estimate.T_cam_port is None else "wrong"
        ax.set_axis_off()
        ax.set_title(f"{LIGHTS[row.light]}, {CAMERAS[row.modality]}\n{said}", fontsize=8)
    fig.savefig(PICTURE, dpi=DPI, facecolor="white", pil_kwargs={"quality": 88})
    plt.close(fig)


def main() -> None:
    matplotlib.use("Agg")
    drawings.use_style()
    judged_images.make()
    rows = answers()
    judged = pd.read_csv(SEEN) if SEEN.exists() else pd.DataFrame(columns=[*KEY, "seen"])
    rows = rows.merge(judged, "left", KEY)
    if len(unknown := rows[rows.seen.isna()]):
        files = draw_to_judge(unknown)
        sys.exit(f"{len(unknown)} images to judge: see {', '.join(map(str, files))}; add rows to {SEEN}")
    rows["seen"] = rows.right | (rows.seen == 1)  # what the estimator reads, a person could
    cells = rows.groupby(["modality", "light"], sort=False)
    table = cells.agg(images=("seen", "size"), seen=("seen", "sum"), right=("right", "sum")).reset_index()
    print(table.assign(percent=100 * table.right / table.seen).round(1).to_string())
    save_table(TABLE, table, set=SET)
    missed = rows[rows.seen & ~rows.right]
    draw_missed(missed.sample(min(SHOWN, len(missed)), random_state=0).sort_index())


if __name__ == "__main__":
    main()
