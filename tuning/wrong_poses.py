"""Counts right, wrong and missing poses, on sequences that neither train nor test anything.

    python tuning/wrong_poses.py

A pose is wrong if it is off by 20 mm, 5 deg of the normal or 10 deg of the rotation.  The shares are of the
images with the whole ring in view (`judged_images`), per light, camera and set of weights; images in doubt
get their further looks.  `ESTIMATORS` compares our settings with those that report every pose, in the table
data/results/wrong-poses.csv.

`LOOKS` asks whether the further looks at images in doubt give more right and no more wrong poses: at the
mean of the masks that the networks give of the image and of the image turned by half a turn, and at a
histogram with more events.  The first look is that of N events, or of more where N give no pose.  That table,
of the default networks, is data/results/turned.csv.
"""

from __future__ import annotations

import os
import time
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import joblib
import numpy as np
import pandas as pd
from choose_thresholds import right
from judged_images import CAMERA, CELLS, PORT, SEQUENCES, Case, Look, cases, make

from lmmap.estimation.estimates import estimate_image
from lmmap.estimation.images import TimedImage
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.looks import one_look
from lmmap.pipeline.network import MaskNetwork
from lmmap.pipeline.weights import FILTERS
from lmmap.settings import OURS, PerCamera, Settings
from lmmap.types import Estimate
from lmmap_lab.provenance import DATA, save_table
from lmmap_lab.studies.sequence_files import looks_of

EVERY_POSE = replace(OURS, min_confidence=PerCamera(0.0, 0.0))
ESTIMATORS = {"every pose": EVERY_POSE, "confident poses": OURS}
FIRST_LOOK = {"first look": replace(OURS, turned_look=False, sure_confidence=0.0)}
LOOKS = {"first look": "first look", "confident poses": "looks again"}  # what the second table calls them


class OnMasks(Estimator):
    """An estimator on masks computed before: those of ``looks``, which come with the image."""

    def __init__(self, modality: str, settings: Settings = OURS):
        self.looks: list[Look] = []
        plain, turned = ([Kept(self, way, k) for k in range(len(FILTERS))] for way in ("masks", "turned"))
        super().__init__(CAMERA, PORT, modality, tuple(plain), settings)
        self.turned = one_look(self, ring_network=turned[0], reflector_network=turned[1])
        self.further = [look._replace(see=self.turned) for look in self.further]

    def once(self, look: Look) -> Estimate:
        """The estimate by one look at an image as it is."""
        self.looks = [look]
        return self.on_grid(look.image)

    def once_turned(self, look: Look) -> Estimate:
        """The estimate by one look at an image and its half turn together."""
        self.looks = [look]
        return self.turned.on_grid(look.image)

    def answer(self, case: Case) -> tuple[Estimate, Look]:
        """The pipeline's estimate of a case, and the look that it comes from."""
        self.looks = case.looks
        first, *wider = case.looks
        timed = TimedImage(0, first.image, (1, wider[0].image) if wider else None)
        _, estimate = estimate_image(self, timed)
        return estimate, case.looks[estimate.t_us]


class Kept(NamedTuple):
    """A network whose masks of the ``looks`` of an `OnMasks` are known: of whole images and of crops."""

    of: OnMasks
    way: str
    number: int
    stride_px = MaskNetwork.stride_px
    inputs_of = staticmethod(MaskNetwork.inputs_of)

    def __call__(self, image: np.ndarray) -> np.ndarray:
        look = next(look for look in self.of.looks if np.may_share_memory(look.image, image))
        start, at = (a.__array_interface__["data"][0] for a in (look.image, image))
        row, column = ((at - start) // step for step in look.image.strides[:2])
        column -= row * (look.image.strides[0] // look.image.strides[1])
        height, width = image.shape[:2]
        return getattr(look, self.way)[self.number][row : row + height, column : column + width]


def outcomes(estimators: dict[str, Settings], set_name: str, modality: str, weights: str) -> pd.DataFrame:
    """A row for each image and estimator: what its answer is, with what confidence, in what CPU time."""
    rows = []
    on_masks = {name: OnMasks(modality, looks_of(weights, s)) for name, s in estimators.items()}
    for case in cases(set_name, modality, weights):
        for name, estimator in on_masks.items():
            began_s = time.thread_time()
            estimate, look = estimator.answer(case)
            took_ms = 1e3 * (time.thread_time() - began_s)
            pose = estimate.T_cam_port is not None
            good = pose and right(estimate.T_cam_port, look.truth, PORT)
            rows.append({"estimator": name, "set": set_name, "sequence": case.name, "light": case.light,
                         "modality": modality, "weights": weights, "status": str(estimate.status),
                         "right": good, "wrong": pose and not good, "none": not pose,
                         "confidence": estimate.confidence, "cpu_ms": took_ms})  # fmt: skip
    return pd.DataFrame(rows)


def of_cells(function, cells=None) -> list:
    """A function's values of ``cells`` (default: `CELLS`), several at once."""
    return joblib.Parallel(os.cpu_count())(joblib.delayed(function)(*cell) for cell in cells or CELLS)


def shares(table: pd.DataFrame, by=("set", "modality", "weights", "light", "estimator")) -> pd.DataFrame:
    """Images, and percentages of them."""
    groups = table.groupby(list(by), sort=False)
    percent = 100 * groups[["right", "wrong", "none"]].mean()
    return percent.add_suffix("_percent").assign(images=groups.size()).reset_index()


def main() -> None:
    make()
    every = pd.concat(of_cells(partial(outcomes, ESTIMATORS | FIRST_LOOK)), ignore_index=True)
    print(every.groupby("estimator").cpu_ms.median().round(1).to_string())
    looked = (
        every[every.weights == OURS.weights].assign(looks=every.estimator.map(LOOKS)).dropna(subset="looks")
    )
    for name, table in {
        "wrong-poses.csv": shares(every[every.estimator.isin(ESTIMATORS)]),
        "turned.csv": shares(looked, ("set", "modality", "light", "looks")),
    }.items():
        print(table.round(1).to_string())
        save_table(DATA / "results" / name, table, sequences=SEQUENCES)


if __name__ == "__main__":
    main()
