"""How many poses are wrong if the limits of a right pose were others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from lmmap.evaluation.error_table import is_wrong
from lmmap.settings import OURS

FACTORS = (0.2, 0.4, 0.6, 0.8, 1.0, 1.4, 2.0, 3.0, 4.0)  # of the limits: 1 to 20 deg of the normal
MEASURED, TRACKED = ("as printed", "exact circle"), ("confident", "fused")  # rungs of the ladder
ALL, NORMAL = "all limits", "the normal's alone"


def wrong_percent(errors: pd.DataFrame, factor: float, limits: str = ALL) -> float:
    """Percentage of the images whose pose is wrong, with the limits of `OURS` times a factor.

    Parameters
    ----------
    errors
        `error_table.errors` of images with the ring in view.
    limits
        `ALL` of them, or `NORMAL`, so that nothing else makes a pose wrong.
    """
    elsewhere = factor if limits == ALL else np.inf
    settings = replace(
        OURS,
        right_position_m=elsewhere * OURS.right_position_m,
        right_normal_rad=factor * OURS.right_normal_rad,
        right_rotation_rad=elsewhere * OURS.right_rotation_rad,
    )
    return 100 * float(is_wrong(errors, settings=settings).mean())


def table(measured: Sequence[pd.DataFrame], tracked: dict[str, Sequence[pd.DataFrame]]) -> pd.DataFrame:
    """``rung, limits, factor, normal_deg, wrong_percent`` of one light, camera and set of networks.

    Parameters
    ----------
    measured
        `ladder.errors` of sequences.
    tracked
        By each of `TRACKED`: `error_table.errors` of sequences.
    """
    tables = {name: [t[t.rung == name] for t in measured] for name in MEASURED} | tracked
    rungs = {name: pd.concat(parts).query("in_view") for name, parts in tables.items()}
    normal_deg = np.rad2deg(OURS.right_normal_rad)
    return pd.DataFrame([
        {"rung": rung, "limits": limits, "factor": factor, "normal_deg": factor * normal_deg,
         "wrong_percent": wrong_percent(errors, factor, limits)}
        for rung, errors in rungs.items() for limits in (ALL, NORMAL) for factor in FACTORS
    ])  # fmt: skip
