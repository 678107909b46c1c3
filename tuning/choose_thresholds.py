"""Chooses the pipeline's thresholds, on sequences that neither train nor test anything.

    python tuning/choose_thresholds.py

``mask_threshold``, ``peak_share`` and ``min_marker_score`` of the settings: for each of their
values (the first two one at a time), how many images with the ring in view get a pose, how many of these
poses are wrong, and how many images without a port get one.  The thresholds stay as they are while they give
no pose without a port, and no others give more right less wrong poses, of both modalities together, than
chance would.  The table is kept in data/results/thresholds.csv, the recordings in data/derived/calibration.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
from calibrate_uncertainty import RATE_HZ, recording
from tqdm import tqdm

from lmmap.estimation.images import images
from lmmap.geometry.port import in_view
from lmmap.pipeline import agreement, circle, yaw
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.masks import reflector_mask
from lmmap.pipeline.ring import find_ring
from lmmap.refinement.contour import Contour
from lmmap.settings import OURS
from lmmap.types import Port, Pose
from lmmap_lab.provenance import DATA, save_table

SEQUENCES = [f"realistic-{i}" for i in range(1001, 1031)] + [f"augmented-{i}" for i in range(1001, 1007)]
EMPTY = [f"empty-{i}" for i in range(1001, 1013)]
MIN_MARKER_SCORES = (0.05, 0.075, 0.1, 0.15, 0.2)
CUTS = [(threshold, OURS.peak_share) for threshold in (0.2, 0.3, 0.4, 0.5, 0.6)] + [
    (OURS.mask_threshold, share) for share in (0.0, 0.7, 0.8, 0.95)
]  # of the mask: threshold, and what a blob must reach
PRESENT = (OURS.mask_threshold, OURS.peak_share, OURS.min_marker_score)
CHANCE = 0.02  # of the images: the standard error of a share of 0.8 of them
NAMES = ("mask_threshold", "sure", "min_marker_score")


def timed_truths(estimator: Estimator):
    """``(sequence, image, true pose or None)`` of what has a ring in view, or no port."""
    for name in [*SEQUENCES, *EMPTY]:
        seen, port = recording(name), not name.startswith("empty")
        for t_us, image in images(seen, estimator.modality, rate_hz=RATE_HZ):
            truth = seen.truth.at(np.array([min(t_us, seen.truth.t_us[-1])]))[0] if port else None
            if truth is None or in_view(truth, estimator.port, seen.camera):
                yield name, image, truth


def right(T: Pose, truth: Pose, port: Port) -> bool:
    return agreement.alike(T, truth, port, OURS)


def answers(estimator: Estimator, image, truth) -> list[dict]:
    """The outcome with each threshold of the masks, and the markers' score that decides."""
    port, camera = estimator.port, estimator.grid
    rows, ring_mask = [], estimator.ring_network(image)
    for threshold, share in CUTS:
        estimator.settings = replace(estimator.settings, mask_threshold=threshold, peak_share=share)
        ring = find_ring(ring_mask, estimator.setup)
        row = {"mask_threshold": threshold, "sure": share, "score": -1.0, "right": False}
        if isinstance(ring, Contour):
            circles = circle.candidates(ring.ellipse, camera, port.ring_radius_m)
            reflectors = reflector_mask(estimator.reflector_network, image, circles, port, camera)
            fit = yaw.fast_yaw(reflectors, circles[:2], port, camera)
            T = fit.T_cam_port
            row |= {"score": fit.score, "right": truth is not None and right(T, truth, port)}
        rows.append({**row, "portless": truth is None})
    return rows


def outcomes(modality: str) -> pd.DataFrame:
    """Counts by thresholds."""
    estimator = Estimator(modality=modality)
    every = [row for _, image, truth in tqdm(list(timed_truths(estimator)), modality)
             for row in answers(estimator, image, truth)]  # fmt: skip
    table, counted = pd.DataFrame(every), []
    for least in MIN_MARKER_SCORES:
        posed = table.assign(pose=table.score >= least, min_marker_score=least)
        posed = posed.assign(
            images=~posed.portless,
            right=posed.pose & posed.right,
            wrong=posed.pose & ~posed.portless & ~posed.right,
            false=posed.pose & posed.portless,
        )
        counted.append(posed.groupby(list(NAMES))[["images", "right", "wrong", "portless", "false"]].sum())
    return pd.concat(counted).reset_index().assign(modality=modality)


def choice(table: pd.DataFrame, present: tuple = PRESENT) -> pd.Series:
    """The present thresholds, or those that are better by more than chance."""
    both = table.groupby(list(NAMES))[["images", "right", "wrong", "false"]].sum().reset_index()
    both["score"] = (both.right - both.wrong) / both.images
    fewest_false = both[both.false == both.false.min()].sort_values("score", ascending=False)
    ours = fewest_false[np.isclose(fewest_false[list(NAMES)], present).all(1)]
    tie = len(ours) and ours.score.iloc[0] >= fewest_false.score.iloc[0] - CHANCE
    return (ours if tie else fewest_false).iloc[0]


def main() -> None:
    table = pd.concat([outcomes(modality) for modality in ("rgb", "event")], ignore_index=True)
    print(table.to_string())
    print(choice(table).to_string())
    save_table(DATA / "results" / "thresholds.csv", table, sequences=[*SEQUENCES, *EMPTY])


if __name__ == "__main__":
    main()
