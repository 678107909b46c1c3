"""What the refinement on the image's edges is worth, and how far to trust it: ``edge_inflation``.

    python tuning/refine_on_edges.py

Poses of the sequences of `wrong_poses` with and without the refinement: medians of their errors, and how
often the 95 % region of position and rotation holds the truth.  The inflation of each camera is the one by
which that is 95 % of the right poses of the tuning sequences, of events at both looks.  The table is
data/results/image-edges.csv.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import wrong_poses
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from lmmap.provenance import DATA, save_table
from lmmap.settings import OURS, PerCamera
from lmmap.studies.metrics import normal_error_rad, position_error_m, rotation_error_rad

PORT = wrong_poses.PORT
REGION = chi2.ppf(0.95, 6)
BASE = replace(OURS, min_confidence=0.0, edge_inflation=PerCamera(1.0, 1.0))
ESTIMATORS = {"before": replace(BASE, edge_rounds=0), "after": BASE}


def squared_distance(T, covariance, truth) -> float:
    """Squared Mahalanobis distance of a pose from the truth, of the port's alike turns the nearest."""
    turns = Rotation.from_rotvec(np.outer(np.arange(PORT.symmetry) * PORT.yaw_period_rad, [0, 0, 1]))
    rotations = Rotation.from_matrix(T.rotation @ np.swapaxes(truth.rotation @ turns.as_matrix(), 1, 2))
    nearest = rotations[int(rotations.magnitude().argmin())].as_rotvec()
    error = np.concatenate([T.position_m - truth.position_m, nearest])
    return float(error @ np.linalg.solve(covariance, error))


def poses(set_name: str, modality: str, weights: str) -> list[dict]:
    """A row for each look at which both estimators have a pose with the right yaw."""
    rows = []
    estimators = {name: wrong_poses.OnMasks(modality, settings) for name, settings in ESTIMATORS.items()}
    for case in wrong_poses.cases(set_name, modality, weights):
        for look in case.looks:
            row = {"set": set_name, "light": case.light, "modality": modality, "weights": weights}
            for name, estimator in estimators.items():
                estimate = estimator.once(look)
                T, truth = estimate.T_cam_port, look.truth
                if T is None or position_error_m(T, truth) > OURS.right_position_m:
                    break
                row |= {f"{name} position_mm": 1e3 * position_error_m(T, truth),
                        f"{name} normal_deg": np.rad2deg(normal_error_rad(T, truth)),
                        f"{name} rotation_deg": np.rad2deg(rotation_error_rad(T, truth, PORT.yaw_period_rad)),
                        f"{name} distance": squared_distance(T, estimate.covariance, truth)}  # fmt: skip
            else:
                if row["before rotation_deg"] < np.rad2deg(OURS.right_rotation_rad):
                    rows.append(row)
    return rows


def main() -> None:
    wrong_poses.make()
    every = pd.DataFrame([row for rows in wrong_poses.of_cells(poses) for row in rows])
    tuning = every[every.set.str.endswith("tuning")]
    inflation = tuning.groupby("modality")["after distance"].quantile(0.95) / REGION
    print("edge_inflation", inflation.round(2).to_dict())
    every["held_percent"] = 100.0 * (every["after distance"] < REGION * every.modality.map(inflation))
    groups = every.drop(columns=["before distance", "after distance", "weights"]).groupby(
        ["set", "modality", "light"], sort=False
    )
    table = (
        groups.median().assign(held_percent=groups.held_percent.mean(), images=groups.size()).reset_index()
    )
    print(table.round(2).to_string())
    save_table(DATA / "results" / "image-edges.csv", table, sequences=wrong_poses.SEQUENCES)


if __name__ == "__main__":
    main()
