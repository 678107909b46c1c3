"""What latency costs: at any time, the last image's pose, the prediction, and the prediction with events.

The estimator works as it does live: whenever it is free, it takes the newest N events, and its answer comes
``LATENCY_S`` later.  Every 10 ms each method says where the port is *now*, and the true pose of that time
judges it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import chi2

from lmmap.estimation.estimates import estimate_image
from lmmap.estimation.images import TimedImage
from lmmap.estimation.windows import windows_at
from lmmap.evaluation.pose_errors import normal_error_rad, pose_difference, position_error_m
from lmmap.geometry.port import in_view
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.histograms import window_histograms
from lmmap.recordings.formats import open_recording
from lmmap.recordings.pose_files import read_estimates, write_estimates
from lmmap.settings import OURS, BetweenSettings
from lmmap.tracking.between import Between
from lmmap.types import Camera, Estimate, Port, Pose, Recording

from ..bench import sequences
from ..bench.writers import write_recording
from ..provenance import DATA, DERIVED_DATA, save_table

RATE_HZ, LATENCY_S = 20.0, 0.05  # of an estimator that takes 50 ms an image
SECONDS = {"1.5": 4.0, "30": 2.0, "150": 2.0}  # of a recording, by the mean speed in mm/s
NUMBERS = (1, 2, 3)  # of each speed; none of them trains or tunes anything
SEQUENCES = {f"speed-{mm_s}-{n}": seconds for mm_s, seconds in SECONDS.items() for n in NUMBERS}
RESULTS, FOLDER = DATA / "results" / "between", DERIVED_DATA / "between"
METHODS = ("last image", "prediction", "prediction and events")
SETUP = sequences.Setup(frame_hz=0.25, step_px=0.6)  # nearly no frames, and events as fine as 2 ms ask
STEP_US = 10_000
SETTLED_S = 0.3  # after the first image: so long a track may take to learn its velocity


@dataclass(frozen=True)
class Arrival:
    """An estimate, and the time at which it is there."""

    at_us: int
    estimate: Estimate


@dataclass(frozen=True)
class Followed:
    """Estimates at times (T,), one list for each of `METHODS`; None where a method has no pose."""

    t_us: np.ndarray
    estimates: dict[str, list[Estimate | None]]
    events: int  # that were at an edge
    updates: int


def kept_recording(name: str, seconds: float, folder: Path, setup: sequences.Setup = SETUP,
                   camera: Camera | None = None) -> Recording:  # fmt: skip
    """A sequence of the bench, by default with events as fine as this study needs; made once."""
    path = folder / f"{name}.h5"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        write_recording(sequences.simulate(name, seconds, setup=setup, camera=camera), path)
    return open_recording(path)


def arrivals(recording: Recording, estimator: Estimator, rate_hz: float = RATE_HZ,
             latency_s: float = LATENCY_S) -> Iterator[Arrival]:  # fmt: skip
    """Estimates of the newest N events at each tick, and when they are there."""
    count, before_us = estimator.settings.events_per_window, None
    for window in windows_at(recording.chunks(), rate_hz, count):
        ((t_us, image),) = window_histograms(window, count, recording.camera.size_px, before_us)
        if before_us is None or t_us > before_us:
            _, e = estimate_image(estimator, TimedImage(t_us, image))
            yield Arrival(int(window["t_us"][-1] + 1e6 * latency_s), e)
            before_us = t_us


def kept_arrivals(recording: Recording, folder: Path) -> list[Arrival]:
    """`arrivals` by the default networks; made once, and kept beside the recording."""
    table, times = folder / f"{recording.name}.csv", folder / f"{recording.name}.arrivals.npy"
    if not times.exists():
        made = list(arrivals(recording, Estimator(recording.camera, modality="event")))
        write_estimates([a.estimate for a in made], table)
        np.save(times, [a.at_us for a in made])
    pairs = zip(np.load(times).tolist(), read_estimates(table), strict=True)
    return [Arrival(at_us, e) for at_us, e in pairs]


def follow(recording: Recording, images: list[Arrival], port: Port, settings: BetweenSettings = OURS.between,
           step_us: int = STEP_US) -> Followed:  # fmt: skip
    """What each method says every ``step_us`` from the first image's arrival on."""
    with_events, without = (Between(recording.camera, port, settings) for _ in range(2))
    events, waiting, last, updates = recording.events, list(images), None, 0
    ticks_us = np.arange(images[0].at_us, events["t_us"][-1], step_us)
    answers = {method: [] for method in METHODS}
    cuts = np.searchsorted(events["t_us"], np.concatenate([[ticks_us[0] - step_us], ticks_us]))
    for t_us, start, stop in zip(ticks_us.tolist(), cuts[:-1], cuts[1:], strict=True):
        while waiting and waiting[0].at_us <= t_us:
            e = waiting.pop(0).estimate
            last = e if e.T_cam_port is not None else last
            with_events.add({"event": e})
            without.add({"event": e})
        updates += with_events.events(events[start:stop])
        now = last, without.at(t_us), with_events.at(t_us)
        for method, e in zip(METHODS, now, strict=True):
            answers[method].append(e if e is not None and e.T_cam_port is not None else None)
    return Followed(ticks_us, answers, with_events.used, updates)


def errors(followed: Followed, recording: Recording, port: Port) -> pd.DataFrame:
    """Errors of each method against the true pose of the time.

    Times count when each method has a pose, the ring is in view, and the track is settled.
    """
    t_us, lists = followed.t_us, followed.estimates
    known = np.array([all(each) for each in zip(*lists.values(), strict=True)])
    if not known.any():
        return pd.DataFrame()
    truth = recording.truth.at(t_us.clip(*recording.truth.t_us[[0, -1]]))
    known &= in_view(truth, port, recording.camera) & (t_us > t_us[known][0] + 1e6 * SETTLED_S)
    known &= t_us <= recording.truth.t_us[-1]
    tables = []
    for method, answers in lists.items():
        chosen = [answers[k] for k in np.flatnonzero(known)]
        if not chosen:
            continue
        T, true = Pose.stack([e.T_cam_port for e in chosen]), truth[known]
        d = pose_difference(T, true, port.yaw_period_rad)
        C = np.array([e.covariance for e in chosen])
        nees = np.einsum("ni,ni->n", d, np.linalg.solve(C, d[..., None])[..., 0])
        score = -0.5 * (nees + np.linalg.slogdet(C)[1])
        tables.append(pd.DataFrame({
            "sequence": recording.name, "method": method, "t_us": t_us[known],
            "position_mm": 1e3 * position_error_m(T, true),
            "normal_deg": np.rad2deg(normal_error_rad(T, true)),
            "rotation_deg": np.rad2deg(np.linalg.norm(d[:, 3:], axis=1)), "nees": nees, "score": score,
            "age_ms": 1e-3 * (t_us[known] - np.array([e.t_us for e in chosen])),
        }))  # fmt: skip
    return pd.concat(tables) if tables else pd.DataFrame()


def summary(table: pd.DataFrame, by=("method",)) -> pd.DataFrame:
    """Medians, 95 % quantiles and the share of true poses inside the 95 % region."""
    groups = table.assign(inside_percent=100.0 * (table.nees < chi2.ppf(0.95, 6))).groupby(
        list(by), sort=False
    )
    return groups.agg(
        times=("t_us", "size"), age_ms=("age_ms", "median"), position_mm=("position_mm", "median"),
        position_95_mm=("position_mm", lambda x: x.quantile(0.95)), normal_deg=("normal_deg", "median"),
        rotation_deg=("rotation_deg", "median"), rotation_95_deg=("rotation_deg", lambda x: x.quantile(0.95)),
        inside_95_percent=("inside_percent", "mean"), score=("score", "mean"),
    )  # fmt: skip


def main() -> None:
    """Makes the committed tables: ``python -m lmmap_lab.studies.between_images``."""
    port, tables, rows = Port.lm_map(), [], []
    for name, seconds in SEQUENCES.items():
        recording = kept_recording(name, seconds, FOLDER)
        images = kept_arrivals(recording, FOLDER)
        poses = sum(a.estimate.T_cam_port is not None for a in images)
        rows.append(
            {"speed_mm_s": name.split("-")[1], "sequence": name, "images": len(images), "found": poses}
        )
        print(rows[-1], flush=True)
        if poses:
            tables.append(errors(follow(recording, images, port), recording, port))
    table = pd.concat(tables)
    table["speed_mm_s"] = table.sequence.str.split("-").str[1]
    facts = {"command": "python -m lmmap_lab.studies.between_images", "sequences": list(SEQUENCES),
             "rate_hz": RATE_HZ, "latency_s": LATENCY_S}  # fmt: skip
    for file, by in (("speeds", ["speed_mm_s", "method"]), ("sequences", ["sequence", "method"])):
        save_table(RESULTS / f"{file}.csv", summary(table, by).reset_index(), **facts)
    save_table(RESULTS / "images.csv", pd.DataFrame(rows), **facts)


if __name__ == "__main__":
    main()
