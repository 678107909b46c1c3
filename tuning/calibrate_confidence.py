"""Calibrates the probability that a pose is right, and chooses below which there is none.

    python tuning/calibrate_confidence.py

Two logistic regressions on `verify.evidence`: of whether position and normal are right, and of whether the
rotation is where they are.  They are fitted to every pose that the estimator finds without a limit on its
confidence, of events at both looks, on the tuning sequences of `wrong_poses`: bench and other laboratory
together, for on the bench alone few poses are wrong.  The results are ``confidence_ring``,
``confidence_yaw`` and ``min_confidence`` of the settings.  The last is the lowest of `LIMITS` at which at
most `WRONG_PERCENT` of the reported poses are wrong, each by a fit to other sequences than its own.
data/results/confidence.csv holds the reliability of the confidence in bins, its expected calibration error,
and what that of a perfect confidence would be: of tuning sequences by the same fits to other ones, of all
other sets by the settings as they stand.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import wrong_poses
from choose_thresholds import right

from lmmap.provenance import DATA, save_table
from lmmap.refinement import verify
from lmmap.settings import OURS, Settings
from lmmap.studies.metrics import normal_error_rad, position_error_m
from lmmap.studies.reliability import calibration_error, error_by_chance, reliability

RIDGE = 1.0  # of standardised slopes
LIMITS = np.arange(0.5, 0.96, 0.01).round(2)
WRONG_PERCENT = 1.5
FOLDS = 8  # of the tuning sequences


class Witness(wrong_poses.OnMasks):
    """An estimator that reports every pose, and keeps its evidence."""

    def confidence(self, T_cam_port, covariance, best, *images) -> float:
        self.evidence = verify.evidence(
            T_cam_port, covariance, best.sigma_rad, best.log_odds, *images, self.port, self.camera
        )
        return 1.0


def poses(set_name: str, modality: str, weights: str) -> list[dict]:
    """A row for each look that has a pose: its evidence, and whether it is right."""
    witness, rows = Witness(modality, replace(OURS, min_confidence=0.0)), []
    for case in wrong_poses.cases(set_name, modality, weights):
        for look in case.looks:
            witness.masks = look.masks
            estimate = witness(look.image)
            if estimate.T_cam_port is not None:
                T, port = estimate.T_cam_port, wrong_poses.PORT
                circle_right = (position_error_m(T, look.truth) < OURS.right_position_m
                                and normal_error_rad(T, look.truth) < OURS.right_normal_rad)  # fmt: skip
                rows.append({
                    "set": set_name, "sequence": case.name, "light": case.light, "modality": modality,
                    "weights": weights, "circle_right": bool(circle_right),
                    "right": right(T, look.truth, port), "evidence": witness.evidence,
                })  # fmt: skip
    return rows


def logistic_fit(evidence, outcome, ridge: float = RIDGE, steps: int = 50) -> np.ndarray:
    """Constant and slopes (K + 1,) of greatest penalised likelihood: Newton's steps on standardised evidence
    (N, K) of outcomes (N,) in {0, 1}."""
    mean, scale = evidence.mean(0), evidence.std(0)
    X = np.column_stack([np.ones(len(evidence)), (evidence - mean) / scale])
    penalty = ridge * np.diag([0.0] + [1.0] * len(scale))
    b = np.zeros(X.shape[1])
    for _ in range(steps):
        p = verify.logistic(X[:, 1:], b)
        hessian = (X.T * (p * (1 - p))) @ X + penalty
        step = np.linalg.solve(hessian, X.T @ (outcome - p) - penalty @ b)
        b = b + step * min(1, 2 / max(np.abs(step).max(), 1e-12))
    return np.concatenate([[b[0] - np.sum(b[1:] * mean / scale)], b[1:] / scale])


def lowest_limit(confidence, outcome) -> float:
    """The lowest of `LIMITS` at which at most `WRONG_PERCENT` of the reported poses are wrong."""
    for limit in LIMITS:
        reported = confidence >= limit
        if 100 * np.mean(~outcome[reported]) <= WRONG_PERCENT:
            return float(limit)
    return float(LIMITS[-1])


def fit(evidence, circle_right, outcome) -> Settings:
    """Settings with both regressions fitted to evidence (N, 6): of whether position and normal are right,
    (N,), and of whether the whole pose is, (N,)."""
    ring = logistic_fit(evidence[:, :4], circle_right).round(3)
    of_yaw = logistic_fit(evidence[circle_right, 3:], outcome[circle_right]).round(3)
    return replace(OURS, confidence_ring=tuple(ring.tolist()), confidence_yaw=tuple(of_yaw.tolist()))


def cross_validated(sequence, evidence, circle_right, outcome) -> np.ndarray:
    """Confidences (N,) of poses, each by a fit that did not see its fold of the sequences (N,)."""
    fold = np.unique(sequence, return_inverse=True)[1] % FOLDS
    confidence = np.zeros(len(evidence))
    for k in range(FOLDS):
        others = fold != k
        settings = fit(evidence[others], circle_right[others], outcome[others])
        confidence[~others] = verify.confidence(evidence[~others], settings)
    return confidence


def main() -> None:
    wrong_poses.make()
    every = pd.DataFrame([row for s in wrong_poses.SETS for m in ("rgb", "event")
                          for w in wrong_poses.WEIGHTS[s] for row in poses(s, m, w)])  # fmt: skip
    evidence, outcome = np.stack(every.evidence), every.right.to_numpy(bool)
    circle_right, sequence = every.circle_right.to_numpy(bool), every.sequence.to_numpy(str)
    tuning = every.set.str.endswith("tuning").to_numpy()
    settings = fit(evidence[tuning], circle_right[tuning], outcome[tuning])
    confidence = verify.confidence(evidence, OURS)  # the other sets judge what ships
    confidence[tuning] = cross_validated(*(a[tuning] for a in (sequence, evidence, circle_right, outcome)))
    print("confidence_ring", settings.confidence_ring, "confidence_yaw", settings.confidence_yaw)
    print("min_confidence", lowest_limit(confidence[tuning], outcome[tuning]))
    tables = []
    for name in wrong_poses.SETS:
        at = (every.set == name).to_numpy()
        table = reliability(confidence[at], outcome[at])
        error, (mean, most) = calibration_error(table), error_by_chance(table)
        tables.append(table.assign(set=name, calibration_error=error, by_chance=mean, by_chance_95=most))
        reported = {limit: outcome[at & (confidence >= limit)] for limit in (0.0, *LIMITS[::5].tolist())}
        counts = {limit: (int(good.sum()), int((~good).sum())) for limit, good in reported.items()}
        print(name, f"error {error:.4f}, by chance {mean:.4f}, limit: (right, wrong)", counts)
    save_table(DATA / "results" / "confidence.csv", pd.concat(tables, ignore_index=True),
               sequences=wrong_poses.SEQUENCES)  # fmt: skip


if __name__ == "__main__":
    main()
