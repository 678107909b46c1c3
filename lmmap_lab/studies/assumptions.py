"""What the paper leaves open, and what it would change: each assumption of its procedure halved and doubled.

    python -m lmmap_lab.studies.assumptions

The images are those of the short profile's test, which ``lmmap reproduce`` makes.  Nothing is chosen by them:
the assumptions are those of `pipeline.printed`, whatever comes out.  The table is kept in
data/results/assumptions.csv.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, replace
from itertools import islice, product

import pandas as pd

from lmmap.estimation.images import timed_images
from lmmap.evaluation import error_table
from lmmap.evaluation.error_table import is_wrong
from lmmap.pipeline.printed import PrintedEstimator
from lmmap.recordings.formats import open_recording
from lmmap.settings import MODALITIES, PAPER, Assumptions
from lmmap.types import Estimate, Port, Recording

from ..provenance import DATA, DERIVED_DATA, save_table
from .ladder import Remembered
from .table1 import LIGHTS

COMMITTED = DATA / "results" / "assumptions.csv"
EVERY = 4  # of the images at the paper's rate: neighbours show nearly the same


def variants(assumed: Assumptions | None = None) -> list[tuple[str, str, Assumptions]]:
    """``(assumption, change, assumptions)``: as they are, and each one halved and doubled."""
    assumed = assumed or Assumptions()
    changes = [
        (name, word, replace(assumed, **{name: type(value)(factor * value)}))
        for (name, value), (word, factor) in product(
            asdict(assumed).items(), (("halved", 0.5), ("doubled", 2.0))
        )
    ]
    return [("none", "as assumed", assumed), *changes]


def estimates(recording: Recording, modality: str, every: int = EVERY) -> Iterable[list[Estimate]]:
    """Estimates of every fourth image by each of `variants`; the networks look once at an image."""
    first = PrintedEstimator(recording.camera, modality=modality)
    masks = Remembered(first.ring_network), Remembered(first.reflector_network)
    estimators = [
        PrintedEstimator(recording.camera, modality=modality, weights=masks, assumptions=changed)
        for _, _, changed in variants()
    ]
    for timed in islice(timed_images(recording, modality, first.settings, PAPER.rate_hz), 0, None, every):
        yield [estimator(timed.image, timed.t_us) for estimator in estimators]


def effects(errors: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """Percent found and wrong of the images with the ring in view, and median errors, a row a variant.

    Parameters
    ----------
    errors
        `error_table.errors` of all images, by each of `variants`.
    """
    rows = []
    for (name, change, assumed), table in zip(variants(), errors, strict=True):
        seen = table[table.in_view]
        rows.append({
            "assumption": name, "change": change, "value": asdict(assumed).get(name),
            "found_percent": 100 * seen.position_error_m.notna().mean(),
            "wrong_percent": 100 * is_wrong(seen).mean(),
            "position_mm": 1e3 * table.position_error_m.median(),
            "normal_deg": table.normal_error_deg.median(), "images": len(seen),
        })  # fmt: skip
    return pd.DataFrame(rows)


def main() -> None:
    tables = [[] for _ in variants()]
    for light, modality in product(LIGHTS, MODALITIES):
        recording = open_recording(DERIVED_DATA / "quick" / f"test-{light}.h5")
        for table, answers in zip(tables, zip(*estimates(recording, modality), strict=True), strict=True):
            table.append(error_table.errors(recording, list(answers), Port.lm_map()))
    table = effects([pd.concat(parts) for parts in tables])
    print(table.to_string())
    save_table(COMMITTED, table, profile="quick", every=EVERY)


if __name__ == "__main__":
    main()
