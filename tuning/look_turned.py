"""Whether further looks at images in doubt give more right and no more wrong poses.

    python tuning/look_turned.py

An image whose ring is seen without a sure pose is looked at again, by the mean of the masks that the networks
give of the image and of the image turned by half a turn, and a histogram with more events as well.  The first
look is that of N events, or of more where N give no pose.  The images are those of `judged_images`, which
neither train nor test anything.  The table goes to data/results/turned.csv.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import judged_images
import pandas as pd
import wrong_poses

from lmmap.settings import OURS
from lmmap_lab.provenance import DATA, save_table

LOOKS = {"first look": replace(OURS, turned_look=False, sure_confidence=0.0), "looks again": OURS}


def main() -> None:
    judged_images.make()
    every = pd.concat(wrong_poses.of_cells(partial(wrong_poses.outcomes, LOOKS)))
    every = every[every.weights == OURS.weights].rename(columns={"estimator": "looks"})
    table = wrong_poses.shares(every, ("set", "modality", "light", "looks"))
    print(table.round(1).to_string())
    save_table(DATA / "results" / "turned.csv", table, sequences=judged_images.SEQUENCES)


if __name__ == "__main__":
    main()
