"""What a tracker gains over its estimator frame by frame, image by image, with intervals.

Both look at the same images, so the share of a difference is known better than either share.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pandas as pd

from lmmap.evaluation.error_table import is_wrong
from lmmap.settings import MODALITIES, OURS

from .accuracy_run import COMMITTED
from .accuracy_tables import DRAWS, SEED, label
from .archive import mark_of, unpack
from .bootstrap import interval
from .table1 import LIGHTS, bootstrap_counts


def gains(
    alone: pd.DataFrame, tracked: pd.DataFrame, draws: int = DRAWS, seed: int = SEED
) -> dict[str, float]:
    """Differences, tracked less frame by frame, of the shares of right and wrong poses.

    Parameters
    ----------
    alone, tracked
        `error_table.errors` of the same images (N,) by estimator and tracker.  Those count that show the
        whole ring at the times of both answers.

    Returns
    -------
    dict
        ``right_points`` and ``wrong_points``, in percent of the images, with the ends of their 95 % intervals
        in ``NAME_low`` and ``NAME_high``.

    Raises
    ------
    ValueError
        For tables of different images.
    """
    if len(alone) != len(tracked):
        raise ValueError(f"tracked: expected {len(alone)} images, got {len(tracked)}")
    seen = alone.in_view.to_numpy(bool) & tracked.in_view.to_numpy(bool)
    counts = bootstrap_counts([len(alone)], draws, seed)
    wrong = [is_wrong(table) for table in (alone, tracked)]
    right = [
        table.position_error_m.notna().to_numpy() & ~w
        for table, w in zip((alone, tracked), wrong, strict=True)
    ]
    gained = {}
    for name, (before, after) in {"right": right, "wrong": wrong}.items():
        change = 100 * (after.astype(float) - before) * seen
        with np.errstate(invalid="ignore"):
            low, high = interval(counts @ change / (counts @ seen.astype(float)))
        gained |= {f"{name}_points": change.sum() / seen.sum(), f"{name}_low": low, f"{name}_high": high}
    return gained


def of_full_test() -> pd.DataFrame:
    """`gains` in the full test by ``light`` and ``camera``, from the committed results of its sequences."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for light in LIGHTS:
            name = f"test-{light}"
            for archive in (name, *(f"tracked-{name}-{camera}" for camera in MODALITIES)):
                packed = COMMITTED / "sequences" / f"{archive}.zip"
                unpack(packed, Path(folder), mark_of(packed))
            for camera in MODALITIES:
                files = f"errors-{label(name, camera, OURS.weights)}.csv", f"tracked-{name}-{camera}.csv"
                alone, tracked = (pd.read_csv(Path(folder) / file) for file in files)
                rows.append({"light": light, "camera": camera, **gains(alone, tracked)})
    return pd.DataFrame(rows)
