"""Right and wrong poses of other sensors and lenses, beside the DAVIS 346 that the networks know.

    python tuning/other_sensors.py [SENSOR ...]

Every sensor records the same short sequences of the bench, which neither train nor test anything, and chose
no setting.  An image counts if the whole ring is in view of the sensor and of the DAVIS 346.  The table has
rows for each sensor, light, camera and ring: "trained" are rings of a size that the networks were trained on
(`Settings.trained_ring_px`), "enlarged" have it in the enlarged frame of a short lens only, "other" are the
rest.  Recordings and outcomes are kept in
data/derived/sensors, so that an interrupted run goes on; remove the .csv files there after a change of the
estimator, and all after a change of the bench.  The table is kept in data/results/sensors.csv.
"""

from __future__ import annotations

import argparse
import time
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
from choose_thresholds import right
from scipy.stats import bootstrap
from tqdm import tqdm

from lmmap.estimation.estimates import estimate_image
from lmmap.estimation.images import timed_images
from lmmap.geometry.conics import circle_ellipse
from lmmap.geometry.port import in_view
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.rescale import outside_training
from lmmap.settings import OURS
from lmmap.types import Camera, Ellipse, Port, Pose, Recording
from lmmap_lab.bench import sequences
from lmmap_lab.bench.laboratory import sequence
from lmmap_lab.provenance import DATA, DERIVED_DATA, save_table
from lmmap_lab.studies.between_images import kept_recording
from lmmap_lab.studies.networks import set_hashes

SEQUENCES = [f"realistic-{n}" for n in range(2101, 2125)]  # eight of each light
SECONDS, FRAME_HZ, EACH = 0.5, 10, 10  # length, frames a second, and most images of each camera from it
FOLDER = DERIVED_DATA / "sensors"
PORT = Port.lm_map()


def pinhole(width_px: int, height_px: int, focal_px: float, distortion=(), model: str = "radtan") -> Camera:
    """A camera whose axis is in the middle of its sensor."""
    centre = (width_px - 1) / 2, (height_px - 1) / 2
    return Camera(width_px, height_px, focal_px, focal_px, *centre, distortion, model)


SENSORS = {
    "DAVIS 346": Camera.davis346(),
    "240 x 180": pinhole(240, 180, 225.0),
    "320 x 240": pinhole(320, 240, 300.0),
    "640 x 480": pinhole(640, 480, 600.0),
    "1280 x 720": pinhole(1280, 720, 1200.0),
    "346 x 260, radial": pinhole(346, 260, 324.0, (-0.3, 0.1, 0.001, -0.001)),
    "640 x 480, equidistant": pinhole(640, 480, 324.0, (0.01, -0.02, 0.003, 0.0), "equidistant"),
    "346 x 260, half the view": pinhole(346, 260, 648.0),
    "640 x 480, twice the view": pinhole(640, 480, 324.0),
    "346 x 260, twice the view": pinhole(346, 260, 162.0),
    "346 x 260, three times the view": pinhole(346, 260, 108.0),
}


def recorded(name: str, sensor: str) -> Recording:
    """A short recording by a sensor; made once."""
    setup = sequences.Setup(frame_hz=FRAME_HZ)
    return kept_recording(name, SECONDS, FOLDER / _label(sensor), setup, SENSORS[sensor])


def true_pose(recording: Recording, t_us: int) -> Pose:
    """The true pose at a time, or at the truth's nearest end."""
    return recording.truth.at(np.clip([t_us], *recording.truth.t_us[[0, -1]]))[0]


def is_seen(truth: Pose, recording: Recording) -> bool:
    """Whether the whole ring is in view of the recording's sensor and of the DAVIS 346."""
    return all(in_view(truth, PORT, camera) for camera in (recording.camera, SENSORS["DAVIS 346"]))


def outcomes(name: str, sensor: str, modality: str) -> list[dict]:
    """A row for each of at most `EACH` images with the ring in view."""
    recording = recorded(name, sensor)
    with warnings.catch_warnings(action="ignore"):  # short lenses are named by the table
        estimator = Estimator(recording.camera, PORT, modality)
    seen = [s for s in timed_images(recording, modality) if is_seen(true_pose(recording, s.t_us), recording)]
    chosen = np.unique(np.linspace(0, len(seen) - 1, min(EACH, len(seen))).astype(int))
    rows = []
    for shot in (seen[i] for i in chosen):
        began_s = time.thread_time()
        _, estimate = estimate_image(estimator, shot)
        took_ms, truth = 1e3 * (time.thread_time() - began_s), true_pose(recording, estimate.t_us)
        pose = estimate.T_cam_port is not None
        good = pose and right(estimate.T_cam_port, truth, PORT)
        ring = circle_ellipse(truth, PORT.ring_radius_m, estimator.grid)
        rows.append({"sequence": name, "sensor": sensor, "focal_px": recording.camera.fx_px,
                     "modality": modality, "light": sequence(name).light,
                     "ring": ring_size(ring, recording.camera, estimator.grid),
                     "right": good, "wrong": pose and not good, "none": not pose,
                     "cpu_ms": took_ms})  # fmt: skip
    return rows


def ring_size(ring: Ellipse, camera: Camera, grid: Camera) -> str:
    """How large the networks see a ring of the pixels of ``grid``: "trained", "enlarged" or "other"."""
    if outside_training(ring):
        return "other"
    own_px = ring.semi_axes_px[0] / max(1.0, grid.fx_px / camera.fx_px)
    return "trained" if own_px >= OURS.trained_ring_px[0] else "enlarged"


def summary(every: pd.DataFrame) -> pd.DataFrame:
    """Images and percentages of them, the median time on one thread, and for all lights together how many
    more points are right than with the DAVIS 346."""
    by = ["sensor", "focal_px", "modality", "ring"]
    lights = pd.concat([every, every.assign(light="all")])
    groups = lights.groupby([*by, "light"], sort=False)
    percent = (100 * groups[["right", "wrong", "none"]].mean()).add_suffix("_percent")
    table = percent.assign(images=groups.size(), cpu_ms=groups.cpu_ms.median().round()).reset_index()
    known = every[every.ring == "trained"]
    for row in table.query("light == 'all' and ring == 'trained' and sensor != 'DAVIS 346'").itertuples():
        of_camera = known[known.modality == row.modality]
        gain = gain_percent(*(of_camera[of_camera.sensor == s] for s in ("DAVIS 346", row.sensor)))
        table.loc[row.Index, ["gain_percent", "gain_percent_low", "gain_percent_high"]] = gain
    return table


def gain_percent(ours: pd.DataFrame, theirs: pd.DataFrame) -> tuple[float, float, float]:
    """By how many points more of their images are right than of ours, and its 95 % interval: a bootstrap of
    the sequences, since images of one sequence are alike.  Of fewer than two sequences it is NaN."""
    counts = [t.groupby("sequence").right.agg(["sum", "count"]) for t in (ours, theirs)]
    both = pd.concat(counts, axis=1, join="inner").to_numpy(float).T

    def gain(right, images, their_right, their_images, axis=-1):
        return 100 * (their_right.sum(axis) / their_images.sum(axis) - right.sum(axis) / images.sum(axis))

    if both.shape[1] < 2:
        return np.nan, np.nan, np.nan
    interval = bootstrap(both, gain, paired=True, method="percentile", rng=np.random.default_rng(0))
    return float(gain(*both)), *interval.confidence_interval


def _label(sensor: str) -> str:
    return sensor.replace(", ", "-").replace(" ", "_")


def _outcome_path(name: str, sensor: str, modality: str) -> Path:
    return FOLDER / f"{name}.{_label(sensor)}.{modality}.csv"


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("sensors", nargs="*", help="default: all that are not made yet, and the table")
    chosen = arguments.parse_args().sensors
    FOLDER.mkdir(parents=True, exist_ok=True)
    runs = [(n, s, m) for n in SEQUENCES for s in chosen or SENSORS for m in ("rgb", "event")]
    for run in tqdm([r for r in runs if not _outcome_path(*r).exists()], disable=None):
        pd.DataFrame(outcomes(*run)).to_csv(_outcome_path(*run), index=False)
    if chosen:
        return
    # a lens of half the view shows no whole ring in one of the sequences, and its file is empty
    files = [_outcome_path(*run) for run in runs]
    every = pd.concat([pd.read_csv(f) for f in files if f.stat().st_size > 2], ignore_index=True)
    table = summary(every.sort_values("sensor", key=lambda s: s.map(list(SENSORS).index), kind="stable"))
    print(table.query("light == 'all'").round(1).to_string())
    facts = {"sequences": SEQUENCES, "networks": set_hashes(OURS.weights)}
    save_table(DATA / "results" / "sensors.csv", table, **facts)


if __name__ == "__main__":
    main()
