"""Calibrates the probability that a pose is right, and chooses below which there is none.

    python tuning/calibrate_confidence.py

Two logistic regressions on `verify.evidence`: of whether position and normal are right, and of whether the
rotation is where they are.  They are fitted to the pose of every look, at each image as it is and with its
half turn, on the tuning sequences of `judged_images`: bench and other laboratory together, for on the bench
alone few poses are wrong.  The estimator's own wrong poses are the best of wrong images: they fit the masks.
So that the evidence is not ignored where it is plain, *misplaced* poses take part with a small weight: right
ones turned by ten degrees, or by half a yaw period, with the standard deviations and odds of the right ones.

How far the markers are off where the port has them has a slope set by hand.  The fit's own would be 0.4 a
pixel: poses are right on ports unlike their CAD, for the refinement knows the port's tolerances.  But a port
beyond them must not raise the confidence.

Then come the answers of several looks.  ``look_independence`` is the one of greatest likelihood, and a
camera's ``min_confidence`` the lowest of `LIMITS` at which at most `WRONG_PERCENT` of its images in high
light get a wrong pose.  Both are chosen on tuning sequences, each judged by a fit to others.
data/results/confidence.csv holds the reliability of the answers' confidence in bins, its expected calibration
error, and what that of a perfect confidence would be: of tuning sequences by the same fits to other ones, of
all other sets by the settings as they stand.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import judged_images
import numpy as np
import pandas as pd
import wrong_poses
from confidence_sights import Sight, Sights, sights

from lmmap.estimation.estimates import estimate_image
from lmmap.estimation.images import TimedImage
from lmmap.pipeline.looks import one_look
from lmmap.refinement import verify
from lmmap.settings import OURS, Settings
from lmmap.types import Estimate
from lmmap_lab.provenance import DATA, save_table
from lmmap_lab.studies.reliability import calibration_error, error_by_chance, reliability
from lmmap_lab.studies.sequence_files import looks_of

RIDGE = 1.0  # of standardised slopes
LIMITS = np.arange(0.5, 0.951, 0.05).round(2)
WRONG_PERCENT = 1.5
OFF_PX, OFF_SLOPE = 3, -1.0  # of the evidence: how far markers are off, and its slope, which is set by hand
INDEPENDENCE = np.arange(0.0, 1.001, 0.05).round(2)
FOLDS = 8  # of the tuning sequences
MISPLACED_SHARE = 0.001  # of all poses, by weight


class Told(wrong_poses.OnMasks):
    """An estimator that is told what its looks show: an image is their estimates, as it is and turned."""

    turn = 0

    def __init__(self, modality: str, settings: Settings):
        super().__init__(modality, settings)
        self.further = [look._replace(see=one_look(self, turn=1)) for look in self.further]

    def to_grid(self, image):
        return image

    def in_camera(self, estimate):
        return estimate

    def on_grid(self, image, t_us=0, near=None):
        return image[self.turn]


def answer(told: Told, looks: list[tuple]) -> tuple[Estimate, bool]:
    """The answer to ``(estimate, right)`` of all looks, and whether it is right."""
    first, *wider = ([estimate for estimate, _ in look] for look in looks)
    _, e = estimate_image(told, TimedImage(0, first, (0, wider[0]) if wider else None))
    return e, next(good for look in looks for estimate, good in look if estimate.ellipse is e.ellipse)


def logistic_fit(evidence, outcome, weight=None, ridge: float = RIDGE, steps: int = 50) -> np.ndarray:
    """Constant and slopes (K + 1,) of greatest penalised likelihood: Newton's steps on standardised evidence
    (N, K) of outcomes (N,) in {0, 1}, each with its weight (N,)."""
    weight = np.ones(len(evidence)) if weight is None else weight
    mean = np.average(evidence, 0, weight)
    scale = np.sqrt(np.average((evidence - mean) ** 2, 0, weight))
    X = np.column_stack([np.ones(len(evidence)), (evidence - mean) / scale])
    penalty = ridge * np.diag([0.0] + [1.0] * len(scale))
    b = np.zeros(X.shape[1])
    for _ in range(steps):
        p = verify.logistic(X[:, 1:], b)
        hessian = (X.T * (weight * p * (1 - p))) @ X + penalty
        step = np.linalg.solve(hessian, X.T @ (weight * (outcome - p)) - penalty @ b)
        b = b + step * min(1, 2 / max(np.abs(step).max(), 1e-12))
    return np.concatenate([[b[0] - np.sum(b[1:] * mean / scale)], b[1:] / scale])


def fit(chosen: list[Sight]) -> Settings:
    """Settings with both regressions fitted to the looks that have a pose."""
    good = [sight for sight in chosen if sight.right]
    share = MISPLACED_SHARE * len(chosen) / max(len(good), 1)  # of weight, for the misplaced ones of each
    evidence = np.stack([sight.evidence for sight in chosen])
    turned = np.concatenate([sight.misplaced[:4] for sight in good])
    other_yaw = np.stack([sight.misplaced[4] for sight in good])
    circle_right = np.array([sight.circle_right for sight in chosen])
    outcome = np.array([sight.right for sight in chosen])
    fitted = [k for k in range(verify.OF_RING) if k != OFF_PX]
    ring = logistic_fit(np.concatenate([evidence, turned])[:, fitted],
                        np.append(circle_right, np.zeros(len(turned))),
                        np.append(np.ones(len(chosen)), np.full(len(turned), share / 4)))  # fmt: skip
    ring[0] -= OFF_SLOPE * np.median(evidence[:, OFF_PX])
    ring = np.insert(ring, 1 + OFF_PX, OFF_SLOPE)
    of_yaw = logistic_fit(np.concatenate([evidence[circle_right], other_yaw])[:, verify.OF_RING - 1 :],
                          np.append(outcome[circle_right], np.zeros(len(other_yaw))),
                          np.append(np.ones(circle_right.sum()), np.full(len(other_yaw), share)))  # fmt: skip
    return replace(OURS, confidence_ring=tuple(ring.round(3).tolist()),
                   confidence_yaw=tuple(of_yaw.round(3).tolist()))  # fmt: skip


def with_pose(rows: list[Sights]) -> list[Sight]:
    return [sight for row in rows for look in row.looks for sight in look if sight.evidence is not None]


def answers(rows: list[Sights], fitted: Settings, settings: Settings) -> Iterator[tuple[Estimate, bool]]:
    """`answer` to each image, each look's confidence by ``fitted``."""

    def judged(sight: Sight):
        e = sight.estimate
        if sight.evidence is not None:
            e = e.judged(float(verify.confidence(sight.evidence, fitted)), 0.0)
        return e, sight.right

    told = {key: Told(key[0], looks_of(key[1], settings)) for key in {row[3:5] for row in rows}}
    return (answer(told[row[3:5]], [tuple(map(judged, look)) for look in row.looks]) for row in rows)


def tuned(rows: list[Sights], changes: Settings = OURS) -> list[tuple[Estimate, bool]]:
    """`answers` to tuning images, each by a fit that did not see its fold of the sequences."""
    fold = np.unique([row.sequence for row in rows], return_inverse=True)[1] % FOLDS
    told = [None] * len(rows)
    for k in range(FOLDS):
        fitted = fit(with_pose([row for row, f in zip(rows, fold, strict=True) if f != k]))
        own = np.flatnonzero(fold == k)
        for i, e in zip(own, answers([rows[i] for i in own], fitted, changes), strict=True):
            told[i] = e
    return told


def log_likelihood(told: list[tuple[Estimate, bool]]) -> float:
    """Of confidences, by whether the poses are right."""
    p = np.array([e.confidence if good else 1 - e.confidence for e, good in told if e.confidence])
    return float(np.log(np.maximum(p, 1e-9)).sum())


def lowest_limits(rows: list[Sights], told: list[tuple[Estimate, bool]]) -> dict[str, float]:
    """For each camera the lowest of `LIMITS` at which at most `WRONG_PERCENT` of its images of an exact port
    in high light get a wrong pose from the default networks."""
    chosen = {}
    for modality in ("rgb", "event"):
        own = [pair for row, pair in zip(rows, told, strict=True)
               if (row.light, row.modality, row.weights) == ("high", modality, OURS.weights)
               and row.set in judged_images.EXACT]  # fmt: skip
        wrong = np.array([e.confidence for e, good in own if e.confidence and not good])
        percent = {limit: 100 * np.sum(wrong >= limit) / len(own) for limit in LIMITS}
        print(f"wrong of {len(own)} in high light, {modality}", pd.Series(percent).round(2).to_dict())
        chosen[modality] = next((float(k) for k in LIMITS if percent[k] <= WRONG_PERCENT), float(LIMITS[-1]))
    return chosen


def main() -> None:
    judged_images.make()
    rows = [row for rows in wrong_poses.of_cells(sights) for row in rows]
    tuning = [row for row in rows if row.set.endswith("tuning")]
    fitted = fit(with_pose(tuning))
    print("confidence_ring", fitted.confidence_ring, "confidence_yaw", fitted.confidence_yaw)
    each = [tuned(tuning, replace(OURS, look_independence=a)) for a in INDEPENDENCE]
    likelihood = pd.Series(map(log_likelihood, each), INDEPENDENCE)
    print("look_independence", likelihood.idxmax(), likelihood.round(2).to_dict())
    told = tuned(tuning)
    print("min_confidence", lowest_limits(tuning, told))
    tables = []
    for name in judged_images.SETS:
        own = [row for row in rows if row.set == name]
        if name.endswith("tuning"):
            of_set = [pair for row, pair in zip(tuning, told, strict=True) if row.set == name]
        else:
            of_set = list(answers(own, OURS, OURS))  # these judge what ships
        posed = [(e.confidence, good) for e, good in of_set if e.confidence]
        confidence, outcome = np.array(posed).T
        table = reliability(confidence, outcome.astype(bool))
        error, (mean, most) = calibration_error(table), error_by_chance(table)
        tables.append(table.assign(set=name, calibration_error=error, by_chance=mean, by_chance_95=most))
        print(name, f"error {error:.4f}, by chance {mean:.4f}")
    save_table(DATA / "results" / "confidence.csv", pd.concat(tables, ignore_index=True),
               sequences=judged_images.SEQUENCES)  # fmt: skip


if __name__ == "__main__":
    main()
