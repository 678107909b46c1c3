"""How often the answer is right, wrong, or absent: a docking camera may give none, but never a wrong one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from lmmap.evaluation.error_table import is_wrong
from lmmap.settings import OURS, Settings

from .reliability import joined

LIMITS = (0.0, *np.arange(0.5, 0.96, 0.05).round(2))  # on the confidence
ESTIMATORS = {"ours": "", "printed": "paper_"}  # prefix of the error columns


def right_and_wrong(tables: Sequence[pd.DataFrame], settings: Settings = OURS) -> pd.DataFrame:
    """Shares of the images with the whole ring in view, in percent, by estimator.

    A pose is wrong if its position is off by more than ``right_position_m``, its normal by more than
    ``right_normal_rad`` or its rotation by more than ``right_rotation_rad``.

    Parameters
    ----------
    tables
        `error_table.errors` of sequences.

    Returns
    -------
    DataFrame
        ``estimator`` (ours, certain, printed), ``right_percent``, ``wrong_percent``, ``none_percent``,
        ``images``.
        *Certain* is ours where its covariance promises that one may dock with it.
    """
    in_view = pd.concat(tables).query("in_view")
    rows = []
    for estimator, prefix in ESTIMATORS.items():
        has_pose = in_view[f"{prefix}position_error_m"].notna().to_numpy()
        wrong = is_wrong(in_view, prefix, settings)
        rows.append((estimator, has_pose, wrong))
        if estimator == "ours":
            rows.append(("certain", has_pose & in_view.certain.to_numpy(bool), wrong))
    return pd.DataFrame([{"estimator": e} | shares(has_pose, wrong) for e, has_pose, wrong in rows])


def by_limit(tables: Sequence[pd.DataFrame], confidences: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """What other limits on the confidence would give: `shares` of the images with the whole ring in view.

    Parameters
    ----------
    tables, confidences
        `error_table.errors` and `reliability.confidences` of sequences.

    Returns
    -------
    DataFrame
        ``limit``, which is one of `LIMITS`, and the columns of `shares`.
    """
    images = joined(tables, confidences).query("in_view")
    answers = {limit: images.right.notna() & (images.confidence >= limit) for limit in LIMITS}
    rows = [{"limit": k} | shares(given, images.right == 0) for k, given in answers.items()]
    return pd.DataFrame(rows)


def shares(has_pose: np.ndarray, wrong: np.ndarray) -> dict[str, float]:
    """Of images (N,) that have a pose, and whose pose is wrong: percentages by answer, and their number."""
    return {
        "right_percent": 100 * (has_pose & ~wrong).mean(),
        "wrong_percent": 100 * (has_pose & wrong).mean(),
        "none_percent": 100 * (~has_pose).mean(),
        "images": len(has_pose),
    }
