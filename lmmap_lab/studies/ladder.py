"""From the paper's procedure to ours, one change after the other, on the same images."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from lmmap.estimation.estimates import estimate_image
from lmmap.estimation.images import TimedImage
from lmmap.evaluation import error_table
from lmmap.evaluation.error_table import METRICS
from lmmap.pipeline import circle, yaw
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.masks import reflector_mask
from lmmap.pipeline.printed import PrintedEstimator
from lmmap.pipeline.rescale import resample
from lmmap.pipeline.ring import find_ring
from lmmap.types import Estimate, Port, Pose, Recording, Status

from . import table1

MEASURED = {  # each rung keeps what the one before it changed
    "as printed": "the paper's text and nothing else",
    "robust ellipse": "hysteresis on the mask, hypotheses in scaled coordinates, refits, a gate on the arc",
    "sub-pixel contour": "the stroke's middle measured on the soft mask, not its skeleton",
    "fine yaw": "a yaw to a fraction of a degree, normals judged by the markers' mean and area",
    "exact circle": "the exact pose of the circle, not the printed formula",
    "ring and markers": "both refined together and on the image, which judges yaw; more events where N fail",
}
TRACKED = {"confident": "a pose only where it is probably right", "fused": "both cameras in one filter"}
RUNGS = MEASURED | TRACKED
EXACT, PRINTED = slice(0, 2), slice(2, 4)  # of `circle.candidates`
ALL_POSES = {"every pose": ("", None, "kept")}
COLUMNS = ["rung", "t_us", "in_view", "kept", *METRICS]


class Remembered:
    """A network that keeps its last masks in each thread, so that several estimators share them."""

    def __init__(self, network: Callable[[np.ndarray], np.ndarray], images: int = 4):
        self.network, self.images, self._kept = network, images, threading.local()

    def __call__(self, image: np.ndarray) -> np.ndarray:
        pairs = self._kept.__dict__.setdefault("pairs", deque(maxlen=self.images))
        for known, mask in pairs:
            if known is image or np.array_equal(known, image):
                return mask
        pairs.append((image, self.network(image)))
        return pairs[-1][1]

    def __getattr__(self, name: str):
        """The network's own attributes: its stride and reach bound the crops on which it has to run."""
        return getattr(self.network, name)


class Ladder:
    """`MEASURED` rungs of each image, and our own estimate of it.  No filter runs twice on the same pixels.

    Parameters
    ----------
    ours
        The estimator at the top.  Its networks are replaced by ones that remember.
    """

    def __init__(self, ours: Estimator):
        ours.ring_network = Remembered(ours.ring_network)
        ours.reflector_network = Remembered(ours.reflector_network)
        same = ours.camera, ours.port, ours.modality, (ours.ring_network, ours.reflector_network)
        self.ours, self.printed = ours, PrintedEstimator(*same, ours.settings)
        no_ray_is_enough = replace(ours.settings, contour_min_rays=np.inf)
        self.by_skeleton = Estimator(*same, no_ray_is_enough)  # its ellipse is that of the skeleton's points

    def __call__(self, timed: TimedImage) -> tuple[Estimate, dict[str, Estimate]]:
        """Our estimate, and the estimates of the rungs by their names."""
        image, t_us = resample(timed.image, self.ours.grid), timed.t_us
        ours = estimate_image(self.ours, timed)[1]
        mask = self.ours.ring_network(image)
        skeleton, contour = (self._ring(e, image, mask) for e in (self.by_skeleton, self.ours))
        status = Status.OK if ours.found is not None else ours.status
        return ours, {
            "as printed": self.printed.on_grid(image, t_us),
            "robust ellipse": self._pose(t_us, skeleton, PRINTED, yaw.paper_yaw),
            "sub-pixel contour": self._pose(t_us, contour, PRINTED, yaw.paper_yaw),
            "fine yaw": self._pose(t_us, contour, PRINTED, yaw.fast_yaw),
            "exact circle": self._pose(t_us, contour, EXACT, yaw.fast_yaw),
            "ring and markers": replace(ours, status=status, T_cam_port=ours.found),
        }

    def _ring(self, estimator: Estimator, image, mask) -> tuple[Pose, np.ndarray] | Status:
        """The four candidates of an estimator's ellipse and the reflector mask, or why there are none."""
        port, camera = estimator.port, estimator.grid
        ring = find_ring(mask, estimator.setup)
        if isinstance(ring, Status):
            return ring
        circles = circle.candidates(ring.ellipse, camera, port.ring_radius_m)
        return circles, reflector_mask(estimator.reflector_network, image, circles, port, camera)

    def _pose(self, t_us: int, ring: tuple[Pose, np.ndarray] | Status, pair: slice, find_yaw) -> Estimate:
        if isinstance(ring, Status):
            return Estimate(t_us, ring)
        candidates, reflectors = ring
        fit = find_yaw(reflectors, candidates[pair], self.ours.port, self.ours.grid)
        return Estimate(t_us, Status.OK, fit.T_cam_port)


def errors(recording: Recording, rungs: Sequence[dict[str, Estimate]], port: Port) -> pd.DataFrame:
    """`COLUMNS` of every image on every measured rung."""
    tables = {name: error_table.errors(recording, [r[name] for r in rungs], port) for name in MEASURED}
    return pd.concat(table.assign(rung=name) for name, table in tables.items())[COLUMNS]


def summary(
    measured: Sequence[pd.DataFrame],
    confident: Sequence[pd.DataFrame],
    fused: Sequence[pd.DataFrame],
    draws: int,
    seed: int,
) -> pd.DataFrame:
    """`table1.summary` of every rung, the variant replaced by ``rung``.

    Parameters
    ----------
    measured
        `errors` of sequences that count as one.
    confident, fused
        `error_table.errors` of our estimates and of the fused track on the same sequences.
    """
    rungs = {name: [table[table.rung == name] for table in measured] for name in MEASURED}
    rungs |= {"confident": confident, "fused": fused}
    parts = [
        table1.summary(tables, draws, seed, variants=ALL_POSES).assign(rung=name)
        for name, tables in rungs.items()
    ]
    return pd.concat(parts).drop(columns="variant")
