"""Judges the set *light* beside the default one: poses, and whether its confidence is one (chooses nothing).

    python tuning/judge_light.py

Images, masks and poses are those of `wrong_poses`, with the settings of the default networks.
data/results/light.csv has, for each camera and light and each set of sequences, and for the tuning ones
together, the shares of right, wrong and missing poses with 95 % intervals, and how many more than with the
default networks are right.  In the rows of all lights are the expected calibration error of the confidence
and what that of a perfect one would be.
"""

from __future__ import annotations

from functools import partial

import numpy as np
import pandas as pd
import wrong_poses
from judge_widths import interval

from lmmap.settings import OURS
from lmmap_lab.provenance import DATA, save_table
from lmmap_lab.studies.networks import set_hashes
from lmmap_lab.studies.reliability import calibration_error, error_by_chance, reliability

JUDGED = ("light", OURS.weights)
CELLS = [(place, m, w) for place in wrong_poses.SETS for m in ("rgb", "event") for w in JUDGED]
GROUPS = {"tuning": [place for place in wrong_poses.SETS if place.endswith("tuning")],
          **{place: [place] for place in wrong_poses.SETS}}  # fmt: skip


def more_right(images: pd.DataFrame, others: pd.DataFrame) -> dict:
    """How many percent more of the same images are right, with its 95 % interval: images of one sequence
    count together."""
    gain = images.right.to_numpy(float) - others.right.to_numpy(float)
    of_sequence = pd.Series(gain - gain.mean()).groupby(images.sequence.to_numpy()).sum()
    half = 1.96 * np.sqrt((of_sequence**2).sum()) / len(gain)
    values = gain.mean(), gain.mean() - half, gain.mean() + half
    return dict(zip(("more_right_percent", "more_low", "more_high"), 100 * np.array(values), strict=True))


def summary(images: pd.DataFrame) -> dict:
    """Shares of right, wrong and missing poses of `wrong_poses.outcomes`, with their intervals."""
    row = {"images": len(images)}
    for what in ("right", "wrong", "none"):
        row[f"{what}_percent"] = 100 * images[what].mean()
        row[f"{what}_low"], row[f"{what}_high"] = interval(images[what].to_numpy(bool))
    return row


def confidence_error(every: pd.DataFrame) -> dict:
    """Expected calibration error over all poses, reported or not, and that of a perfect confidence."""
    posed = every[~every.none]
    table = reliability(posed.confidence.to_numpy(float), posed.right.to_numpy(bool))
    return {"calibration_error": calibration_error(table), "by_chance_95": error_by_chance(table)[1]}


def main() -> None:
    wrong_poses.make(CELLS)
    found = pd.concat(wrong_poses.of_cells(partial(wrong_poses.outcomes, wrong_poses.ESTIMATORS), CELLS))
    rows = []
    for place, places in GROUPS.items():
        of_place = found[found.set.isin(places)]
        for (modality, light), images in [
            *of_place.groupby(["modality", "light"], sort=False),
            *(((m, "all"), t) for m, t in of_place.groupby("modality", sort=False)),
        ]:
            reported = images[images.estimator == "confident poses"]
            default = reported[reported.weights == OURS.weights]
            for weights, own in reported.groupby("weights"):
                row = {"set": place, "modality": modality, "weights": weights, "light": light, **summary(own)}
                if weights != OURS.weights:
                    row |= more_right(own, default)
                if light == "all":
                    of_set = images[(images.estimator == "every pose") & (images.weights == weights)]
                    row |= confidence_error(of_set)
                rows.append(row)
    table = pd.DataFrame(rows)
    print(table.round(2).to_string())
    save_table(DATA / "results" / "light.csv", table, networks={w: set_hashes(w) for w in JUDGED})


if __name__ == "__main__":
    main()
