"""Chooses what `motion.Motion` assumes and where `tracking.certain` draws its line, on sequences that neither
train nor test anything.

    python benchmarks/tune_fusion.py

Realistic sequences under every light and on both skins, each also with frames, events or both taken away
for a while, because a filter that coasts must know how far it may.  The score is the logarithmic score of
the true pose under the fused covariance, which rewards small errors and honest covariances alike.  Settings
that are behind the best by less than a standard error of that difference, over sequences, are as good: of
these, the one whose 95 % region holds nearest to 95 % of the true poses.
Estimates are kept in data/derived/fusion, so a second run takes minutes; grid and choices go to
data/results/fusion.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pandas as pd
from calibrate_uncertainty import log_scores, mahalanobis
from scipy.stats import chi2
from tqdm import tqdm

from lmmap import sequences
from lmmap.core import Port, Status
from lmmap.fusion import fuse
from lmmap.geometry import in_view
from lmmap.metrics import normal_error_rad, pose_difference, position_error_m
from lmmap.motion import Motion
from lmmap.pipeline import Estimator, estimate, in_time, true_poses
from lmmap.recordings import open_recording, read_estimates, write_estimates, write_npz
from lmmap.results import DATA, DERIVED, fingerprint, save_json, save_table
from lmmap.tracking import sigmas
from lmmap.trajectories import stacked

SEQUENCES = [f"realistic-{i}" for i in range(1101, 1107)]
SECONDS, RATE_HZ = 8.0, 10.0
MODALITIES = ("rgb", "event")
SILENT_S = {"rgb": (2.0, 4.0), "event": (3.5, 5.5)}  # both for half a second
ACCELERATION_M, ACCELERATION_RAD = (0.01, 0.02, 0.04, 0.08), (0.05, 0.1, 0.2, 0.4)
CORRELATION_S = (0.0, 0.05, 0.1, 0.2, 0.4)
LOST_S = (0.2, 0.3, 0.5, 0.8, 1.2)
RIGHT_M, RIGHT_RAD = 0.020, np.deg2rad(5.0)  # a pose that one may dock on


def measured(name: str):
    """The recording of a sequence and its estimates by modality; made once for each state of the filters."""
    folder = DERIVED / "fusion"
    folder.mkdir(parents=True, exist_ok=True)
    path, mark = folder / f"{name}.npz", fingerprint(patterns=("data/weights/*-low.*",))[:8]
    if not path.exists():
        write_npz(sequences.simulate(name, SECONDS), path)
    recording, found = open_recording(path), {}
    for modality in MODALITIES:
        table = folder / f"{name}-{modality}-{mark}.csv"
        if not table.exists():
            estimator = Estimator(recording.camera, modality=modality)
            write_estimates(list(estimate(recording, estimator, RATE_HZ)), table)
        found[modality] = read_estimates(table)
    return recording, found


def silenced(found: dict) -> dict:
    """The estimates with each modality's replaced by failures for a while."""

    def failed(modality, e):
        first_s, last_s = SILENT_S[modality]
        return replace(e, status=Status.NO_RING, T_cam_port=None) if first_s < e.t_us * 1e-6 < last_s else e

    return {modality: [failed(modality, e) for e in some] for modality, some in found.items()}


def errors(recording, estimates, port: Port) -> pd.DataFrame:
    """Squared Mahalanobis distances and log scores of the truth, and errors, of estimates with a pose."""
    known, truth = true_poses(recording, [e for e in estimates if e.T_cam_port is not None])
    T = stacked([e.T_cam_port for e in known])
    d = pose_difference(T, truth, port.yaw_period_rad)
    C = np.array([e.covariance for e in known])
    nees = mahalanobis(d, C)
    return pd.DataFrame({"nees": nees, "score": log_scores(nees, C),
                         "in_view": in_view(truth, port, recording.camera),
                         "position_error_m": position_error_m(T, truth),
                         "normal_error_rad": normal_error_rad(T, truth)})  # fmt: skip


def right(table: pd.DataFrame) -> pd.Series:
    return (table.position_error_m < RIGHT_M) & (table.normal_error_rad < RIGHT_RAD)


def scored(cases, motion: Motion, port: Port) -> pd.DataFrame:
    tables = [errors(recording, fuse(in_time(found), port.yaw_period_rad, RATE_HZ, motion), port)
              .assign(sequence=recording.name) for recording, found in cases]  # fmt: skip
    return pd.concat(tables).query("in_view")


def behind(by_sequence: pd.DataFrame) -> pd.DataFrame:
    """How far each setting's score (a row, a column per sequence) is ``behind`` the best one's, and the
    standard error (``chance``) of that."""
    apart = by_sequence.loc[by_sequence.mean(axis=1).idxmax()] - by_sequence
    return pd.DataFrame({"behind": apart.mean(axis=1), "chance": apart.sem(axis=1)})


def choice(grid: pd.DataFrame) -> pd.Series:
    """The most honest of the settings that are as good as the best."""
    return grid.loc[(grid.inside_95_percent - 95).abs().where(grid.behind <= grid.chance).idxmin()]


def main() -> None:
    port, plain = Port.lm_map(), [measured(name) for name in SEQUENCES]
    cases = plain + [(recording, silenced(found)) for recording, found in plain]
    steps = [np.diff(recording.truth.T_cam_port.position_m, axis=0) for recording, _ in plain]
    turns = [pose_difference(r.truth.T_cam_port[:-1], r.truth.T_cam_port[1:], np.pi)[:, 3:] for r, _ in plain]
    start = Motion(
        speed_m_s=round(float(np.sqrt(np.mean(np.concatenate(steps) ** 2))) * sequences.TRUTH_HZ, 2),
        rate_rad_s=round(float(np.sqrt(np.mean(np.concatenate(turns) ** 2))) * sequences.TRUTH_HZ, 2),
    )
    rows, by_sequence = [], []
    for values in tqdm(list(product(ACCELERATION_M, ACCELERATION_RAD, CORRELATION_S)), "grid"):
        names = ("acceleration_m", "acceleration_rad", "correlation_s")
        chosen = dict(zip(names, values, strict=True))
        table = scored(cases, replace(start, **chosen), port)
        inside = 100 * (table.nees < chi2.ppf(0.95, 6)).mean()
        rows.append({**chosen, "score": table.score.mean(), "inside_95_percent": inside, "poses": len(table)})
        by_sequence.append(table.groupby("sequence").score.mean())
    grid = pd.DataFrame(rows).join(behind(pd.DataFrame(by_sequence).reset_index(drop=True)))
    best = choice(grid)
    motion = replace(start, **{name: float(best[name]) for name in names})

    silent = {s: scored(cases[len(plain) :], replace(motion, lost_s=s), port) for s in LOST_S}
    new = {s: len(table) - len(silent[LOST_S[0]]) for s, table in silent.items()}
    wrong = {s: int((~right(table)).sum() - (~right(silent[LOST_S[0]])).sum()) for s, table in silent.items()}
    lost_s = max(s for s in LOST_S if wrong[s] <= 0.05 * max(new[s], 1))

    alone = [(e, r) for recording, found in plain for some in found.values()
             for e, r in _judged(recording, some, port) if r]  # fmt: skip
    known = np.array([sigmas(e) for e, _ in alone])
    line_m, line_rad = np.quantile(known, 0.99, axis=0)
    choices = {
        "motion": {**motion.__dict__, "lost_s": lost_s},
        "max_position_sigma_m": round(float(line_m), 4),
        "max_normal_sigma_deg": round(float(np.rad2deg(line_rad)), 1),
        "inside_95_percent": float(best.inside_95_percent),
    }
    facts = {"command": "python benchmarks/tune_fusion.py", "sequences": SEQUENCES, "seconds": SECONDS}
    save_table(DATA / "results" / "fusion" / "grid.csv", grid, **facts)
    print(save_json(DATA / "results" / "fusion" / "choices.json", choices, **facts).read_text())


def _judged(recording, estimates, port: Port):
    known = [e for e in true_poses(recording, estimates)[0] if e.T_cam_port is not None]
    return zip(known, right(errors(recording, known, port)), strict=True)


if __name__ == "__main__":
    main()
