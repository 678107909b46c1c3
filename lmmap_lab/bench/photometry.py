"""How bright the bench is: shares of black and white pixels around the port, and the strengths of the lamps.

For each level of light the paper states the share of saturated pixels in the port's region of interest, and
no more.  `calibrate_lamps` sets the bench's three free strengths (exposure, earthshine, sun) to these rows,
on training trajectories; its result is `laboratory.GAIN`, `EARTHSHINE` and `SUN`.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.optimize import minimize

from lmmap.types import Camera, Port

from ..provenance import DATA
from . import labels, laboratory, optics, renderer, sequences

BLACK, WHITE = 10, 245  # of 255, brightest channel: below is the paper's "low" saturation, above its "high"
LIGHTS = ("low", "medium", "high")
TRAJECTORIES = ("realistic-1", "realistic-3", "realistic-5")
POSES = 8  # of each trajectory


def roi_saturation_percent(frame, region) -> tuple[float, float]:
    """Percent of black and of white pixels of ``frame`` in the bounding box of ``region`` (H, W) bool."""
    rows, columns = np.nonzero(region)
    box = frame[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1].max(-1)
    return 100 * float(np.mean(box < BLACK)), 100 * float(np.mean(box > WHITE))


def paper_saturation_percent() -> np.ndarray:
    """The paper's rows: percent (black, white) of the region in low, medium and high light, (3, 2)."""
    rows = pd.read_csv(DATA / "paper" / "other_results.csv")
    value = rows[rows["where"] == "table 1"].set_index(["quantity", "condition"]).value.astype(float)
    return np.array([[value[f"RoI saturation, {end}", f"{light} light"] for end in ("low", "high")]
                     for light in LIGHTS])  # fmt: skip


def lamp_images(camera: Camera, port: Port, trajectories=TRAJECTORIES, poses: int = POSES):
    """Radiance around the port under each lamp alone, of unit strength, and the port's regions.

    They are those of ``poses`` on each of the trajectories, as far as the port is in view.

    Returns
    -------
    images (P, 3, H, W, 3) : colocated lamp, earthshine, sun
    regions : P masks (H, W)
    """
    rays, images, regions = renderer.ray_grid(camera, 2), [], []
    black = np.zeros((camera.height_px, camera.width_px, 3), np.float32)
    high, medium = (laboratory.lamps(laboratory.sequence(f"test-{light}")) for light in ("high", "medium"))
    lamps = [renderer.Lamps(*(values[[i]] for values in several))
             for several, i in ((high, 0), (medium, 1), (high, 1))]  # fmt: skip
    strengths = np.float32([1.0, laboratory.EARTHSHINE, laboratory.SUN])
    for name in trajectories:
        seq = laboratory.sequence(name)
        solid, skin = laboratory.panel(seq, port)
        for pose in laboratory.sequence_motion(seq, np.linspace(0, 60, poses)):
            region = labels.label_masks(pose, port, camera).any(0)
            if not region.any():
                continue
            regions.append(region)
            radiances = [renderer.render(solid, skin, lamp, pose, rays, black)[0] for lamp in lamps]
            images.append([optics.apply_lens(radiance, sequences.LENS_BLUR_PX) / strength
                           for radiance, strength in zip(radiances, strengths, strict=True)])  # fmt: skip
    return np.array(images, np.float32), regions


def mean_saturation_percent(images, regions, gain: float, earthshine: float, sun: float) -> np.ndarray:
    """Mean percent (black, white) of the regions in low, medium and high light, (3, 2)."""
    percents = []
    for strengths in ([1, 0, 0], [1, earthshine, 0], [1, 0, sun]):
        radiances = np.einsum("l,plhwc->phwc", np.array(strengths, np.float32), images)
        rng = np.random.default_rng(0)
        frames = [optics.expose(radiance, gain, rng) for radiance in radiances]
        percents.append([roi_saturation_percent(*pair) for pair in zip(frames, regions, strict=True)])
    return np.mean(percents, 1)


def calibrate_lamps(report=print) -> dict:
    """Exposure, earthshine and sun whose saturated shares come nearest to the paper's."""
    camera, port, wanted = Camera.davis346(), Port.lm_map(), paper_saturation_percent()
    images, regions = lamp_images(camera, port)

    def squared_error(log_strengths):
        percent = mean_saturation_percent(images, regions, *np.exp(log_strengths))
        report(f"{np.exp(log_strengths).round(4)} -> {percent.round(1).ravel()}")
        return float(np.sum((percent - wanted) ** 2))

    start = np.log([laboratory.GAIN, laboratory.EARTHSHINE, laboratory.SUN])
    result = minimize(squared_error, start, method="Nelder-Mead", options={
        "xatol": 0.01, "fatol": 0.5, "maxiter": 120,
        "initial_simplex": start + np.vstack([np.zeros(3), np.eye(3)])})  # fmt: skip
    gain, earthshine, sun = (float(v) for v in np.exp(result.x))
    return {
        "gain": gain,
        "earthshine": earthshine,
        "sun": sun,
        "published_percent": wanted.tolist(),
        "bench_percent": mean_saturation_percent(images, regions, gain, earthshine, sun).tolist(),
    }
