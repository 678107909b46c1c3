"""How bright the bench is: shares of the port's region that are black or white, and the lamps' calibration.

The paper states, for each level of light, the share of saturated pixels in the port's region of interest,
and no more.  `calibrate_lamps` sets the three free strengths of the bench (exposure, earthshine, sun) to
these rows, on training trajectories; its result is `laboratory.GAIN`, `EARTHSHINE` and `SUN`.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.optimize import minimize

from ..provenance import DATA
from ..types import Camera, Port
from . import labels, laboratory, optics, renderer, sequences

BLACK, WHITE = 10, 245  # of 255, brightest channel: below is "low" saturation, above is "high"
LIGHTS = ("low", "medium", "high")
TRAJECTORIES = ("realistic-1", "realistic-3", "realistic-5")
POSES = 8  # of each


def roi_saturation_percent(frame, region) -> tuple[float, float]:
    """Percent of the bounding box of ``region`` (H, W) bool in ``frame`` that is black, and white."""
    rows, columns = np.nonzero(region)
    box = frame[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1].max(-1)
    return 100 * float(np.mean(box < BLACK)), 100 * float(np.mean(box > WHITE))


def paper_saturation_percent() -> np.ndarray:
    """The paper's rows: percent (black, white) of the region in low, medium and high light, (3, 2)."""
    rows = pd.read_csv(DATA / "paper" / "other_results.csv")
    value = rows[rows["where"] == "table 1"].set_index(["quantity", "condition"]).value.astype(float)
    return np.array([[value[f"RoI saturation, {end}", f"{light} light"] for end in ("low", "high")]
                     for light in LIGHTS])  # fmt: skip


def lamp_images(camera: Camera, port: Port):
    """Radiance of the port's surroundings per lamp of unit strength, (P, 3 lamps, H, W, 3), and regions."""
    rays, images, regions = renderer.ray_grid(camera, 2), [], []
    black = np.zeros((camera.height_px, camera.width_px, 3), np.float32)
    lamps = (
        laboratory.lamps(laboratory.sequence("test-high")),
        laboratory.lamps(laboratory.sequence("test-medium")),
    )
    strengths = {0: 1.0, 1: laboratory.EARTHSHINE, 2: laboratory.SUN}
    single = [(lamps[0], 0), (lamps[1], 1), (lamps[0], 1)]  # colocated, earthshine, sun
    for name in TRAJECTORIES:
        seq = laboratory.sequence(name)
        solid, skin = laboratory.panel(seq, port)
        for pose in laboratory.sequence_motion(seq, np.linspace(0, 60, POSES)):
            region = labels.label_masks(pose, port, camera).any(0)
            if not region.any():
                continue
            regions.append(region)
            parts = [renderer.Lamps(*(values[[i]] for values in lamp)) for lamp, i in single]
            radiances = [renderer.render(solid, skin, part, pose, rays, black)[0] for part in parts]
            images.append([optics.apply_lens(radiance, sequences.LENS_BLUR_PX) / np.float32(strengths[k])
                           for k, radiance in enumerate(radiances)])  # fmt: skip
    return np.array(images, np.float32), regions


def mean_saturation_percent(images, regions, gain: float, earthshine: float, sun: float) -> np.ndarray:
    """Mean percent (black, white) of the regions in low, medium and high light, (3, 2)."""
    found = []
    for weights in ([1, 0, 0], [1, earthshine, 0], [1, 0, sun]):
        frames = np.einsum("l,plhwc->phwc", np.array(weights, np.float32), images)
        rng = np.random.default_rng(0)
        found.append(
            [
                roi_saturation_percent(optics.expose(f, gain, rng), r)
                for f, r in zip(frames, regions, strict=True)
            ]
        )
    return np.mean(found, 1)


def calibrate_lamps(report=print) -> dict:
    """Exposure, earthshine and sun whose saturated shares come nearest to the published ones."""
    camera, port, wanted = Camera.davis346(), Port.lm_map(), paper_saturation_percent()
    images, regions = lamp_images(camera, port)

    def miss(logs):
        got = mean_saturation_percent(images, regions, *np.exp(logs))
        report(f"{np.exp(logs).round(4)} -> {got.round(1).ravel()}")
        return float(np.sum((got - wanted) ** 2))

    start = np.log([laboratory.GAIN, laboratory.EARTHSHINE, laboratory.SUN])
    found = minimize(miss, start, method="Nelder-Mead", options={"xatol": 0.01, "fatol": 0.5, "maxiter": 120,
                     "initial_simplex": start + np.vstack([np.zeros(3), np.eye(3)])})  # fmt: skip
    gain, earthshine, sun = (float(v) for v in np.exp(found.x))
    return {
        "gain": gain,
        "earthshine": earthshine,
        "sun": sun,
        "published_percent": wanted.tolist(),
        "bench_percent": mean_saturation_percent(images, regions, gain, earthshine, sun).tolist(),
    }
