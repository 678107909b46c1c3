"""The tracker against its estimator frame by frame: how often each is right, and how soon after a loss."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from lmmap.estimation.estimates import estimate_image
from lmmap.estimation.images import timed_images
from lmmap.estimation.tracks import track_images
from lmmap.evaluation import error_table
from lmmap.evaluation.error_table import is_wrong
from lmmap.pipeline.estimator import Estimator
from lmmap.settings import OURS, PAPER, Settings
from lmmap.tracking.tracker import Tracker
from lmmap.types import AnyRecording, Estimate, Status

from ..bench import sequences
from .right_and_wrong import shares
from .sequence_files import estimates_fingerprint


def errors_frame_by_frame(recording: AnyRecording, estimator: Estimator, rate_hz: float | None = PAPER.rate_hz
                   ) -> pd.DataFrame:  # fmt: skip
    """`error_table.errors` of a recording's images, each estimated alone."""
    images = timed_images(recording, estimator.modality, estimator.settings, rate_hz)
    return error_table.errors(recording, [estimate_image(estimator, i)[1] for i in images], estimator.port)


def errors_tracked(recording: AnyRecording, estimator: Estimator, rate_hz: float | None = PAPER.rate_hz
            ) -> pd.DataFrame:  # fmt: skip
    """`error_table.errors` of a recording's images tracked.

    Those answers count that an image supports; predictions are no poses here.
    """
    images = timed_images(recording, estimator.modality, estimator.settings, rate_hz)
    estimates = [_without_prediction(e) for _, e in track_images(images, Tracker(estimator))]
    return error_table.errors(recording, estimates, estimator.port)


def mark(name: str, modality: str, seconds: float, function: Callable = errors_tracked) -> str:
    """Fingerprint of a function's errors of a sequence by the default networks."""
    code = sequences.simulate, function
    return estimates_fingerprint(modality, OURS.weights, name, str(seconds), code=code)


def rates(tables: Sequence[pd.DataFrame], settings: Settings = OURS) -> dict[str, float]:
    """Shares in percent of the images with the whole ring in view, and how soon the port is found again.

    Parameters
    ----------
    tables
        `error_table.errors` of sequences.

    Returns
    -------
    dict
        `right_and_wrong.shares`.  ``losses``: how often the ring came back;
        ``found_late``: of these, after how many neither the first nor the second image had a right pose.
    """
    whole = pd.concat(tables).query("in_view")
    wrong, seen = is_wrong(whole, "", settings), whole.position_error_m.notna().to_numpy()
    waits = [wait for table in tables for wait in images_to_a_right_pose(table, settings)]
    late = {"losses": len(waits), "found_late": sum(wait > 2 for wait in waits)}
    return shares(seen, wrong) | late


def images_to_a_right_pose(table: pd.DataFrame, settings: Settings = OURS) -> list[float]:
    """For each time that the whole ring comes into view, the number of the first image with a right pose; inf
    where none is right before it leaves.  Views of a single image do not count."""
    in_view = table.in_view.to_numpy(bool)
    right = table.position_error_m.notna().to_numpy() & ~is_wrong(table, "", settings)
    comes = np.flatnonzero(in_view[1:] & ~in_view[:-1]) + 1
    waits = []
    for first in comes:
        stays = np.argmin(np.append(in_view[first:], False))
        if stays > 1:
            hits = np.flatnonzero(right[first : first + stays])
            waits.append(float(hits[0] + 1) if len(hits) else np.inf)
    return waits


def _without_prediction(e: Estimate) -> Estimate:
    return e if e.status == Status.OK else replace(e, T_cam_port=None, covariance=None)
