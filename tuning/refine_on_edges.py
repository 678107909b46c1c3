"""What the refinement on the image's edges is worth, and how far to trust it: ``edge_inflation`` and
``edge_fading``.

    python tuning/refine_on_edges.py

Poses of the sequences of `judged_images` with and without the refinement: medians of their errors, and how
often the 95 % region of position and rotation holds the truth.  By one inflation for all images the regions
are too large in low light, where markers are clear, and too small in high light.  So the covariance is
inflated by ``edge_inflation / score ** edge_fading``, of the score of the markers.  Both come, by camera, of
the quantile regression (Koenker and Bassett 1978) of the squared distances of the right poses of the tuning
sequences at 95 %, of events at both looks.  The table is data/results/image-edges.csv.
"""

from __future__ import annotations

from dataclasses import replace

import judged_images
import numpy as np
import pandas as pd
import wrong_poses
from calibrate_uncertainty import difference, mahalanobis
from scipy.optimize import linprog
from scipy.stats import chi2

from lmmap.evaluation.pose_errors import normal_error_rad, position_error_m, rotation_error_rad
from lmmap.settings import OURS, PerCamera
from lmmap_lab.provenance import DATA, save_table

PORT = judged_images.PORT
REGION = chi2.ppf(0.95, 6)
HELD = 0.95  # of the right poses
BASE = replace(wrong_poses.EVERY_POSE, edge_inflation=PerCamera(1.0, 1.0), edge_fading=PerCamera(0.0, 0.0))
ESTIMATORS = {"before": replace(BASE, edge_rounds=0), "after": BASE}


def poses(set_name: str, modality: str, weights: str) -> list[dict]:
    """A row for each look at which both estimators have a pose with the right yaw."""
    rows = []
    estimators = {name: wrong_poses.OnMasks(modality, settings) for name, settings in ESTIMATORS.items()}
    for case in judged_images.cases(set_name, modality, weights):
        for look in case.looks:
            row = {"set": set_name, "light": case.light, "modality": modality}
            for name, estimator in estimators.items():
                estimate = estimator.once(look)
                T, truth = estimate.T_cam_port, look.truth
                if T is None or position_error_m(T, truth) > OURS.right_position_m:
                    break
                off = difference(T, truth, PORT)
                row |= {f"{name} position_mm": 1e3 * position_error_m(T, truth),
                        f"{name} normal_deg": np.rad2deg(normal_error_rad(T, truth)),
                        f"{name} rotation_deg": np.rad2deg(rotation_error_rad(T, truth, PORT.yaw_period_rad)),
                        f"{name} distance": mahalanobis(off[None], estimate.covariance[None])[0]}  # fmt: skip
            else:
                if row["before rotation_deg"] < np.rad2deg(OURS.right_rotation_rad):
                    rows.append(row | {"score": estimate.marker_score})
    return rows


def quantile_fit(X, y, share: float) -> np.ndarray:
    """Coefficients (K,) of X (N, K) whose sum is above y (N,) in this share of the rows: those of the least
    sum of ``share`` times what y is above, and ``1 - share`` times what it is below."""
    rows, columns = X.shape
    cost = np.concatenate([np.zeros(columns), np.full(rows, share), np.full(rows, 1 - share)])
    equal = np.hstack([X, np.eye(rows), -np.eye(rows)])
    bounds = [(None, None)] * columns + [(0, None)] * (2 * rows)
    return linprog(cost, A_eq=equal, b_eq=y, bounds=bounds).x[:columns]


def inflation_of(table: pd.DataFrame) -> tuple[float, float]:
    """``edge_inflation`` and ``edge_fading`` of a camera's poses."""
    X = np.column_stack([np.ones(len(table)), -np.log(table.score)])
    constant, fading = quantile_fit(X, np.log(table["after distance"] / REGION).to_numpy(), HELD)
    return float(np.exp(constant)), float(fading)


def main() -> None:
    judged_images.make()
    every = pd.DataFrame([row for rows in wrong_poses.of_cells(poses) for row in rows])
    tuning = every[every.set.str.endswith("tuning")]
    every["held_percent"] = np.nan
    for modality, own in tuning.groupby("modality"):
        inflation, fading = inflation_of(own)
        print(f"{modality}: edge_inflation {inflation:.2f}, edge_fading {fading:.2f}")
        each = every[every.modality == modality]
        held = each["after distance"] < REGION * inflation / each.score**fading
        every.loc[each.index, "held_percent"] = 100.0 * held
    columns = ["before distance", "after distance", "score"]
    groups = every.drop(columns=columns).groupby(["set", "modality", "light"], sort=False)
    table = (
        groups.median().assign(held_percent=groups.held_percent.mean(), images=groups.size()).reset_index()
    )
    print(table.round(2).to_string())
    save_table(DATA / "results" / "image-edges.csv", table, sequences=judged_images.SEQUENCES)


if __name__ == "__main__":
    main()
