"""What each shipped set of networks is worth on materials that nothing was trained on.

    python tuning/validate_robust.py

Images come from `validation_world`, conditions from `validation_conditions`.  data/results/robust.csv: each
set of networks under each condition.  Images are kept in data/derived/validation, so that an interrupted run
goes on; remove that folder after changing any of this.
"""

from __future__ import annotations

import argparse

import numpy as np
import pandas as pd
import validation_world as world
from validation_conditions import CONDITIONS, cases

from lmmap.geometry.conics import circle_ellipse
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.masks import reflector_mask
from lmmap.pipeline.network import CHANNELS
from lmmap.pipeline.ring import find_ring
from lmmap.pipeline.weights import shipped_sets
from lmmap.refinement.contour import Contour
from lmmap.settings import OURS
from lmmap_lab.provenance import DATA, load_table, save_table
from lmmap_lab.studies.networks import set_hashes
from lmmap_lab.training.mask_quality import iou

NEAR_PX, NEAR_SIZE = 2.0, 0.05  # of the centre and, relative, of the axes: an ellipse that is the ring's


def is_ring(ring, T) -> bool:
    """Whether `find_ring` found an ellipse, and the true one."""
    if not isinstance(ring, Contour):
        return False
    true = circle_ellipse(T, world.PORT.ring_radius_m, world.CAMERA)
    away_px = np.linalg.norm(ring.ellipse.centre_px - true.centre_px)
    return bool(
        away_px < NEAR_PX and np.allclose(ring.ellipse.semi_axes_px, true.semi_axes_px, rtol=NEAR_SIZE)
    )


def scores(modality: str, estimator: Estimator) -> list[dict]:
    """A row a condition and filter: mean IoU, and in how many images the ring's ellipse is found."""
    rows, cut = [], estimator.settings.mask_threshold
    for name, condition in CONDITIONS[modality].items():
        fits, rings, marked = [], [], []
        for image, (ring, markers), T in cases(condition):
            mask = estimator.ring_network(image)
            fits.append(iou(mask > cut, ring))
            rings.append(is_ring(find_ring(mask, estimator.setup), T))
            seen = reflector_mask(estimator.reflector_network, image, T[None], estimator.port, estimator.grid)
            marked.append(iou(seen > cut, markers))
        row = {"modality": modality, "condition": name, "images": len(fits)}
        rows.append(row | {"filter": "ring", "iou": np.mean(fits), "found_percent": 100 * np.mean(rings)})
        rows.append(row | {"filter": "reflector", "iou": np.mean(marked)})
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.parse_args()
    world.make()
    table = []
    for gap in shipped_sets():
        for modality in CHANNELS:
            rows = scores(modality, Estimator(modality=modality, weights=gap))
            table += [{"networks": gap, **row} for row in rows]
            print(f"{gap}, {modality}: IoU {np.mean([row['iou'] for row in rows]):.3f}", flush=True)
    path = save_table(DATA / "results" / "robust.csv", pd.DataFrame(table), sequences=world.SEQUENCES,
                      networks=set_hashes(OURS.weights),
                      pictures=world.PICTURES, near_px=NEAR_PX, near_size=NEAR_SIZE)  # fmt: skip
    wide = load_table(path).pivot_table(
        ["iou", "found_percent"], ["modality", "filter", "condition"], "networks"
    )
    print(wide.round(2).to_string())


if __name__ == "__main__":
    main()
