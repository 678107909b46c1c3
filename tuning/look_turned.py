"""Whether a second look, at an image and at its half turn, gives more right and no more wrong poses.

    python tuning/look_turned.py

With ``turned_look`` an image whose ring is seen without a sure pose is looked at again, by the mean of the
masks that the networks give of the image and of the image turned by half a turn.  The images are those of
`wrong_poses`, which neither train nor test anything.  The table goes to data/results/turned.csv.
"""

from __future__ import annotations

from dataclasses import replace

import pandas as pd
import wrong_poses
from choose_thresholds import right
from tqdm import tqdm

from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.run import TimedImage, estimate_image
from lmmap.provenance import DATA, save_table
from lmmap.settings import OURS

LOOKS = {"one look": OURS, "turned too": replace(OURS, turned_look=True)}


def outcomes(set_name: str, modality: str) -> list[dict]:
    """A row for each image and way to look."""
    camera, port, rows = wrong_poses.CAMERA, wrong_poses.PORT, []
    estimators = {look: Estimator(camera, port, modality, settings=s) for look, s in LOOKS.items()}
    for case in wrong_poses.cases(set_name, modality, OURS.weights):
        first, *wider = case.looks
        timed = TimedImage(0, first.image, (1, wider[0].image) if wider else None)
        for look, estimator in estimators.items():
            _, e = estimate_image(estimator, timed)
            pose = e.T_cam_port is not None
            good = pose and right(e.T_cam_port, case.looks[e.t_us].truth, port)
            rows.append({"set": set_name, "modality": modality, "light": case.light, "looks": look,
                         "right": good, "wrong": pose and not good, "none": not pose})  # fmt: skip
    return rows


def main() -> None:
    wrong_poses.make()
    cells = [(s, m) for s in wrong_poses.SETS for m in ("rgb", "event")]
    every = pd.DataFrame([row for cell in tqdm(cells, disable=None) for row in outcomes(*cell)])
    table = wrong_poses.shares(every, ("set", "modality", "light", "looks"))
    print(table.round(1).to_string())
    save_table(DATA / "results" / "turned.csv", table, sequences=wrong_poses.SEQUENCES)


if __name__ == "__main__":
    main()
