"""Chooses how many events are looked at where N of them show no port, on sequences that neither train nor
test anything.

    python tuning/choose_look.py

Glitter and lit edges can use up N events before the port has moved.  Of the images with the ring in view and
no pose from N events, it counts by light how many have one from more events that end with the same one, how
many of these are right and how many hold the true pose in their 95 % region.  The setting
``second_look_factor`` stays as it is unless another factor gives more right poses than chance would.  The
table is kept in data/results/looks.csv.
"""

from __future__ import annotations

from math import ceil

import numpy as np
import pandas as pd
from calibrate_uncertainty import RATE_HZ, SEQUENCES, difference, mahalanobis, recording
from choose_thresholds import right
from scipy.stats import chi2
from tqdm import tqdm

from lmmap.estimation.windows import windows_at
from lmmap.geometry.port import in_view
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.histograms import histogram, middle_us
from lmmap.settings import OURS
from lmmap.tracking.within_limits import is_certain
from lmmap.types import Estimate
from lmmap_lab.bench.laboratory import sequence
from lmmap_lab.provenance import DATA, save_table

# from 3 on, a window's middle would not come after that of the N events before, and poses' times must rise
FACTORS = (1.0, 1.5, 2.0, 2.5)


def seen_at(estimator: Estimator, window, truth_of) -> tuple[Estimate, bool, bool]:
    """The estimate from a window's events, whether it is right, and whether its region holds the truth."""
    t_us = middle_us(window)
    e = estimator(histogram(window["x"], window["y"], estimator.camera.size_px), t_us)
    if e.T_cam_port is None:
        return e, False, False
    truth = truth_of(t_us)
    nees = mahalanobis(difference(e.T_cam_port, truth, estimator.port)[None], e.covariance[None])
    return e, right(e.T_cam_port, truth, estimator.port), bool(nees[0] < chi2.ppf(0.95, 6))


def measured(estimator: Estimator, name: str) -> list[dict]:
    """A row for each factor of each image in view: wider ones only where N events show no port."""
    seen, count, rows = recording(name), estimator.settings.events_per_window, []
    most = int(max(FACTORS) * count)

    def truth_of(t_us):
        return seen.truth.at(np.clip([t_us], seen.truth.t_us[0], seen.truth.t_us[-1]))[0]

    for window in windows_at(seen.chunks(), RATE_HZ, count, ceil(max(FACTORS))):
        truth = truth_of(middle_us(window[-count:]))
        if len(window) < most or not in_view(truth, estimator.port, seen.camera):
            continue
        for factor in FACTORS:
            e, good, inside = seen_at(estimator, window[-int(factor * count) :], truth_of)
            has_pose = e.T_cam_port is not None
            (sure,) = is_certain([e])
            rows.append({"light": sequence(name).light, "factor": factor, "images": 1, "found": has_pose,
                         "right": good, "inside": inside, "certain": sure,
                         "certain_right": sure and good})  # fmt: skip
            if factor == 1 and has_pose:
                break
    return rows


def choice(table: pd.DataFrame, present: float) -> float:
    """The factor with the most right poses, or the present one if it has as many but for a standard error."""
    counts = table[table.factor > 1].groupby("factor")[["images", "right"]].sum()
    best = counts.right.idxmax()
    images, share = counts.images[best], counts.right[best] / counts.images[best]
    chance = np.sqrt(images * share * (1 - share))
    return present if counts.right[present] >= counts.right[best] - chance else float(best)


def main() -> None:
    estimator = Estimator(modality="event")
    rows = [row for name in tqdm(SEQUENCES, disable=None) for row in measured(estimator, name)]
    table = pd.DataFrame(rows).groupby(["light", "factor"]).sum().reset_index()
    print(table.to_string())
    print("second_look_factor", choice(table, OURS.second_look_factor))
    save_table(DATA / "results" / "looks.csv", table, sequences=SEQUENCES)


if __name__ == "__main__":
    main()
