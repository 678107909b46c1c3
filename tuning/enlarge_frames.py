"""How far to enlarge frames of lenses that show the ring too small for the networks.

    python tuning/enlarge_frames.py

The script tries factors up to the one that reaches the networks' focal length, on short sequences of the
bench that neither train nor test anything.  Only images count whose whole ring the DAVIS 346 sees, too.
data/results/enlargement.csv has the images with a right and with a wrong pose for each lens and factor.  The
factor "any" counts images that have one at any factor, which is what further looks could add at most.
"""

from __future__ import annotations

import warnings
from dataclasses import replace

import pandas as pd
from choose_thresholds import right
from other_sensors import FRAME_HZ, PORT, SENSORS, is_seen, true_pose
from tqdm import tqdm
from wrong_poses import SETS

from lmmap.estimation.estimates import estimate_image
from lmmap.estimation.images import timed_images
from lmmap.pipeline.estimator import Estimator
from lmmap.settings import OURS, PerCamera, Settings
from lmmap_lab.bench import sequences
from lmmap_lab.provenance import DATA, save_table

SEQUENCES, SECONDS = list(SETS["bench, tuning"]), 0.3
LENSES = ("240 x 180", "346 x 260, twice the view", "346 x 260, three times the view")
FACTORS = (1.0, 1.2, 1.44, 2.0)  # at most: no frame is enlarged beyond the networks' focal length


def outcomes(name: str, lens: str) -> list[dict]:
    """A row for each frame and factor."""
    camera, rows = SENSORS[lens], []
    setup = sequences.Setup(frame_hz=FRAME_HZ)
    recording = sequences.simulate(name, SECONDS, camera=camera, setup=setup)
    with warnings.catch_warnings(action="ignore"):  # short lenses are named by the table
        estimators = {factor: Estimator(camera, PORT, "rgb", settings=enlarged(factor)) for factor in FACTORS}
    for shot in timed_images(recording, "rgb"):
        truth = true_pose(recording, shot.t_us)
        if not is_seen(truth, recording):
            continue
        for factor, estimator in estimators.items():
            pose = estimate_image(estimator, shot)[1].T_cam_port
            good = pose is not None and right(pose, truth, PORT)
            rows.append({"lens": lens, "image": (name, shot.t_us), "factor": str(factor), "right": good,
                         "wrong": pose is not None and not good})  # fmt: skip
    return rows


def enlarged(factor: float) -> Settings:
    """Settings that enlarge frames by a factor at most."""
    return replace(OURS, enlargement=PerCamera(rgb=factor, event=1.0))


def main() -> None:
    runs = [(name, lens) for lens in LENSES for name in SEQUENCES]
    every = pd.DataFrame([row for run in tqdm(runs, disable=None) for row in outcomes(*run)])
    any_factor = every.groupby(["lens", "image"], sort=False)[["right", "wrong"]].max().reset_index()
    both = pd.concat([every, any_factor.assign(factor="any")])
    groups = both.groupby(["lens", "factor"], sort=False)
    table = groups[["right", "wrong"]].sum().assign(images=groups.size()).reset_index()
    print(table.to_string())
    save_table(DATA / "results" / "enlargement.csv", table, sequences=SEQUENCES)


if __name__ == "__main__":
    main()
