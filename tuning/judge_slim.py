"""Judges the set *slim* beside the default one: poses, and whether its confidence is one (chooses nothing).

    python tuning/judge_slim.py

Images, masks and poses are those of `judged_images`, with the settings of the default networks.
data/results/slim.csv has, for each camera and light and each set of sequences, and for the tuning ones
together, the shares of right, wrong and missing poses with 95 % intervals, and how many more than with the
default networks are right.  In the rows of all lights are the expected calibration error of the confidence
and what that of a perfect one would be.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import judged_images
import numpy as np
import pandas as pd
import wrong_poses
from judge_widths import shares

from lmmap.settings import MODALITIES, OURS
from lmmap_lab.provenance import DATA, save_table
from lmmap_lab.studies.networks import set_hashes
from lmmap_lab.studies.reliability import calibration_error, error_by_chance, reliability

JUDGED = ("slim", OURS.weights)
CELLS = [(place, m, w) for place in judged_images.SETS for m in MODALITIES for w in JUDGED]
GROUPS = {"tuning": [place for place in judged_images.SETS if place.endswith("tuning")],
          **{place: [place] for place in judged_images.SETS}}  # fmt: skip


def more_right(images: pd.DataFrame, others: pd.DataFrame) -> dict:
    """How many percent more of the same images are right, with its 95 % interval: images of one sequence
    count together."""
    gain = images.right.to_numpy(float) - others.right.to_numpy(float)
    of_sequence = pd.Series(gain - gain.mean()).groupby(images.sequence.to_numpy()).sum()
    half = 1.96 * np.sqrt((of_sequence**2).sum()) / len(gain)
    values = gain.mean(), gain.mean() - half, gain.mean() + half
    names = (f"more_right_{end}" for end in ("percent", "low", "high"))
    return dict(zip(names, 100 * np.array(values), strict=True))


def reported(found: pd.DataFrame) -> pd.DataFrame:
    """Rows of every pose found, as they are where those below the limit of confidence are not reported."""
    least = found.modality.map({m: OURS.min_confidence[m] for m in MODALITIES})
    sure = found.confidence >= least
    return found.assign(right=found.right & sure, wrong=found.wrong & sure, none=found.none | ~sure)


def confidence_error(found: pd.DataFrame) -> dict:
    """Expected calibration error over all poses, reported or not, and that of a perfect confidence."""
    posed = found[~found.none]
    table = reliability(posed.confidence.to_numpy(float), posed.right.to_numpy(bool))
    return {"calibration_error": calibration_error(table), "by_chance_95": error_by_chance(table)[1]}


def rows_of(found: pd.DataFrame) -> Iterator[dict]:
    """Of all poses found in some sequences: a row for each camera, light and set of networks."""
    every = pd.concat([found, found.assign(light="all")])
    for (modality, light), images in every.groupby(["modality", "light"], sort=False):
        default = reported(images[images.weights == OURS.weights])
        for weights, own in images.groupby("weights"):
            answers = reported(own)
            row = {"modality": modality, "light": light, "weights": weights, "images": len(own),
                   **shares(answers, ("right", "wrong", "none"))}  # fmt: skip
            if weights != OURS.weights:
                row |= more_right(answers, default)
            yield row | (confidence_error(own) if light == "all" else {})


def main() -> None:
    judged_images.make(CELLS)
    outcomes = partial(wrong_poses.outcomes, {"every pose": wrong_poses.EVERY_POSE})
    found = pd.concat(wrong_poses.of_cells(outcomes, CELLS), ignore_index=True)
    table = pd.DataFrame([{"set": name, **row} for name, places in GROUPS.items()
                          for row in rows_of(found[found.set.isin(places)])])  # fmt: skip
    print(table.round(2).to_string())
    save_table(DATA / "results" / "slim.csv", table, networks={w: set_hashes(w) for w in JUDGED})


if __name__ == "__main__":
    main()
