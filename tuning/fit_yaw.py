"""Weighs mask and image for normal and yaw: ``yaw_weights`` of the settings.

    python tuning/fit_yaw.py

A multinomial logistic regression for each camera: of all normals and yaws, those near the truth shall be the
most probable.  It is fitted to the images of the tuning sequences of `judged_images`, of ports as in
their CAD, in which one of the ring's two circles is right, of events at both looks.
data/results/yaw-weights.csv holds, for each set of sequences, how often the most probable normal and yaw are
right: by the mask alone, and with the image.
"""

from __future__ import annotations

from dataclasses import replace

import judged_images
import numpy as np
import pandas as pd
import wrong_poses
from choose_thresholds import right
from scipy.optimize import minimize
from scipy.special import logsumexp

from lmmap.evaluation.pose_errors import normal_error_rad, position_error_m
from lmmap.geometry.markers import polar_template
from lmmap.pipeline import circle, outline, yaw
from lmmap.pipeline.masks import reflector_mask
from lmmap.pipeline.ring import find_ring
from lmmap.refinement.contour import Contour
from lmmap.settings import OURS, PerCamera
from lmmap_lab.provenance import DATA, save_table

NEAR_RAD = np.deg2rad(4.0)  # of the true yaw: what shall be probable
RIDGE = 1.0  # of standardised weights
PORT, CAMERA = judged_images.PORT, judged_images.CAMERA


def views(set_name: str, modality: str, weights: str) -> list[dict]:
    """A row for each look whose ring is right: what speaks for each normal and yaw (2, yaws, 4), which of
    them are true (2, yaws), and whether `yaw.fast_yaw` is right by mask, and by mask and image."""
    estimator, rows = wrong_poses.OnMasks(modality, OURS), []
    for case in judged_images.cases(set_name, modality, weights):
        for look in case.looks:
            estimator.looks = [look]
            ring = find_ring(look.masks[0], estimator.setup)
            if not isinstance(ring, Contour):
                continue
            pair = circle.poses(ring.ellipse, CAMERA, PORT.ring_radius_m)
            normal_rad = normal_error_rad(pair, look.truth)
            position_m = position_error_m(pair[0], look.truth)
            if normal_rad.min() > OURS.right_normal_rad or position_m > OURS.right_position_m:
                continue
            reflectors = reflector_mask(estimator.reflector_network, look.image, pair, PORT, CAMERA)
            edges = outline.edges(look.image)
            fits = {"mask": yaw.fast_yaw(reflectors, pair, PORT, CAMERA),
                    "both": yaw.fast_yaw(reflectors, pair, PORT, CAMERA, OURS, edges,
                                         OURS.yaw_weights[modality])}  # fmt: skip
            rows.append({
                "set": set_name, "sequence": case.name, "light": case.light, "modality": modality,
                "features": features(reflectors, edges, pair),
                "true": near_truth(pair, look.truth, normal_rad),
                **{name: right(fit.T_cam_port, look.truth, PORT) for name, fit in fits.items()},
            })  # fmt: skip
    return rows


def marker_means(reflector_mask, pair) -> np.ndarray:
    """Mean of the mask (H, W) inside the markers of two poses at each yaw of the grid, (2, yaws): the first
    of what `fast_yaw` weighs."""
    _, template, _ = polar_template(PORT, OURS.yaw_step_rad)
    return yaw.correlate(reflector_mask, pair, PORT, CAMERA, OURS)[1] / template.sum()


def features(reflectors, edges, pair) -> np.ndarray:
    """Mean of the mask inside the markers, and `outline.support`, at every normal and yaw (2, yaws, 4)."""
    seen = outline.support(edges, pair, PORT, CAMERA, round(PORT.yaw_period_rad / OURS.yaw_step_rad))
    return np.concatenate([marker_means(reflectors, pair)[..., None], seen], -1)


def near_truth(pair, truth, normal_rad) -> np.ndarray:
    """Which normals and yaws are `NEAR_RAD` from the truth, (2, yaws)."""
    turn = np.swapaxes(pair.rotation, 1, 2) @ truth.rotation
    true_rad = np.arctan2(turn[:, 1, 0] - turn[:, 0, 1], turn[:, 0, 0] + turn[:, 1, 1])
    period = PORT.yaw_period_rad
    yaws = np.arange(0, period - OURS.yaw_step_rad / 2, OURS.yaw_step_rad)
    off_rad = (yaws - true_rad[:, None] + period / 2) % period - period / 2
    alike = normal_rad <= max(normal_rad.min() + np.deg2rad(2), 0)
    return (np.abs(off_rad) <= NEAR_RAD) & alike[:, None]


def multinomial_fit(features, true, ridge: float = RIDGE) -> np.ndarray:
    """Weights (K,) of greatest penalised likelihood, of choices (N, M, K) of which some are true (N, M)."""
    scale = features.std((0, 1))
    x = features / scale

    def cost(w):
        z = x @ w
        return np.sum(logsumexp(z, 1) - logsumexp(z, 1, b=true)) + ridge * w @ w / 2

    return minimize(cost, np.zeros(len(scale))).x / scale


def main() -> None:
    judged_images.make()
    every = pd.DataFrame([row for rows in wrong_poses.of_cells(views) for row in rows])
    exact, weights = every.set.isin(judged_images.EXACT), {}
    for modality in ("rgb", "event"):
        chosen = every[every.set.str.endswith("tuning") & exact & (every.modality == modality)]
        x = np.stack([f.reshape(-1, f.shape[-1]) for f in chosen.features])
        fitted = multinomial_fit(x, np.stack([t.ravel() for t in chosen.true]))
        weights[modality] = tuple(fitted.round(2).tolist())
    print("yaw_weights", replace(OURS, yaw_weights=PerCamera(**weights)).yaw_weights)
    groups = every.groupby(["set", "modality", "light"], sort=False)
    table = (100 * groups[["mask", "both"]].mean()).add_suffix("_right_percent")
    table = table.assign(images=groups.size()).reset_index()
    print(table.round(1).to_string())
    save_table(DATA / "results" / "yaw-weights.csv", table, sequences=judged_images.SEQUENCES)


if __name__ == "__main__":
    main()
