"""The noise of real masks: how far the paper's procedure puts the ring's ellipse from the true one.

    python -m lmmap_lab.studies.five_degrees_masks

It runs on the first seconds of the bench's tests, with the paper's two sets of networks.  The same images are
those of any lens and radius with the same product, so `five_degrees` may use the differences with each.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pandas as pd

from lmmap.estimation.images import timed_images
from lmmap.geometry.conics import circle_ellipse
from lmmap.pipeline import circle
from lmmap.pipeline.masks import reflector_mask
from lmmap.pipeline.printed import PrintedEstimator
from lmmap.pipeline.rescale import resample
from lmmap.pipeline.yaw import paper_yaw
from lmmap.settings import MODALITIES, PAPER
from lmmap.types import Recording

from ..bench import sequences
from ..provenance import DATA, save_table
from . import formula
from .five_degrees import EXACT, Scene, chart
from .ladder import Remembered
from .table1 import DOMAIN_GAPS, LIGHTS

COMMITTED = DATA / "results" / "five-degrees-masks.csv"
SECONDS = 4.0
CELL = ["training", "light", "modality"]
NOISE = ["u_px", "v_px", "flat_u_px", "flat_v_px", "mean_px"]
LEAST_PX = 0.05  # of a cell's noise


def differences(recording: Recording, modality: str, gap: str) -> pd.DataFrame:
    """Of each image with an ellipse: its time, the ellipse less the true one in `five_degrees.chart`, and
    whether the markers chose the further of both normals, exact and printed."""
    estimator = PrintedEstimator(recording.camera, modality=modality, weights=gap)
    estimator.ring_network = Remembered(estimator.ring_network)
    port, camera, rows = estimator.port, estimator.grid, []
    for timed in timed_images(recording, modality, estimator.settings, PAPER.rate_hz):
        image = resample(timed.image, camera)
        answer = estimator.on_grid(image, timed.t_us)
        if answer.ellipse is None:
            continue
        truth = recording.truth.at(timed.t_us)
        exact = circle.poses(answer.ellipse, camera, port.ring_radius_m)
        mask = reflector_mask(estimator.reflector_network, image, exact, port, camera)
        fit = paper_yaw(mask, exact, port, camera)
        off = chart(answer.ellipse) - chart(circle_ellipse(truth, port.ring_radius_m, camera))
        pairs = (fit.T_cam_port, fit.rival), (answer.T_cam_port, answer.rival)
        wrong = [T.normal @ truth.normal < rival.normal @ truth.normal for T, rival in pairs]
        rows.append((timed.t_us, *off, *map(int, wrong)))
    return pd.DataFrame(rows, columns=["t_us", *NOISE, "wrong_exact", "wrong_printed"])


def mask_scene(table: pd.DataFrame, scene: Scene) -> Scene:
    """A scene with the noise and the choices of a table of `differences` by `CELL`, one run after the other.

    Each cell's noise is in units of its own size, the robust standard deviation of the ellipticity.
    """
    runs = []
    for _, cell in table.groupby(CELL, sort=False):
        off = cell[NOISE].to_numpy()
        size_px = 1.4826 * np.median(np.abs(off[:, 2:4] - np.median(off[:, 2:4], 0)))
        runs.append(off / max(size_px, LEAST_PX))
    at = np.arange(len(scene.follows)) % len(table)
    exact, printed = (table[name].to_numpy(bool)[at] for name in ("wrong_exact", "wrong_printed"))
    wrong = {EXACT: exact, **dict.fromkeys(formula.READINGS, printed)}
    return replace(scene, noise=np.concatenate(runs)[at], wrong=wrong)


def main() -> None:
    parts = []
    for light in LIGHTS:
        recording = sequences.simulate(f"test-{light}", SECONDS)
        for gap, modality in product(DOMAIN_GAPS[:1], MODALITIES):
            rows = differences(recording, modality, gap)
            print(f"test-{light}, {modality}, {gap}: {len(rows)} ellipses", flush=True)
            parts.append(rows.assign(training=gap, light=light, modality=modality))
    save_table(COMMITTED, pd.concat(parts)[[*CELL, *parts[0].columns.drop(CELL)]], seconds=SECONDS)


if __name__ == "__main__":
    main()
