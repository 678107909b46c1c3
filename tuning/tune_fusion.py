"""Chooses `MotionSettings`, on sequences that neither train nor test anything.

    python tuning/tune_fusion.py
    python tuning/tune_fusion.py --present    # only how well the present settings do, with today's estimates

Realistic sequences under every light and on both skins, each also with frames, events or both taken away
for a while, because a filter that coasts must know how far it may.  The score is the logarithmic score of
the true pose under the fused covariance.  It alone would take sharper and sharper regions as long as they
gain more than the poses outside of them cost.  So only those settings count whose 95 % region holds 95 % of
the true poses, within a standard error over sequences; of these the one with the best score is chosen.
How many right and wrong poses `is_certain` keeps is measured on the same estimates.  These are kept in
data/derived/fusion, so a second run takes minutes; grid and choices go to data/results/fusion, and the
present settings' share of true poses inside the region to its present.json.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from itertools import product

import numpy as np
import pandas as pd
from calibrate_uncertainty import log_scores, mahalanobis
from scipy.stats import chi2
from tqdm import tqdm

from lmmap.estimation.estimates import estimate, merge_by_time
from lmmap.evaluation.pose_errors import normal_error_rad, pose_difference, position_error_m, true_poses
from lmmap.geometry.port import in_view
from lmmap.pipeline.estimator import Estimator
from lmmap.recordings.pose_files import read_estimates, write_estimates
from lmmap.settings import MODALITIES, OURS, MotionSettings
from lmmap.tracking.fusion import fuse
from lmmap.tracking.within_limits import is_certain
from lmmap.types import Port, Pose, Status
from lmmap_lab.bench import sequences
from lmmap_lab.provenance import DATA, DERIVED_DATA, save_json, save_table
from lmmap_lab.studies.between_images import kept_recording
from lmmap_lab.studies.sequence_files import estimates_fingerprint

SEQUENCES = [f"realistic-{i}" for i in range(1101, 1113)]
SECONDS, RATE_HZ = 8.0, 10.0
SILENT_S = {"rgb": (2.0, 4.0), "event": (3.5, 5.5)}  # both for half a second
ACCELERATION_M, ACCELERATION_RAD = (0.01, 0.02, 0.04, 0.08), (0.05, 0.1, 0.2, 0.4)
CORRELATION_S = (0.0, 0.05, 0.1, 0.2, 0.4)
LOST_S = (0.2, 0.3, 0.5, 0.8, 1.2)


def measured(name: str):
    """The recording of a sequence and its estimates by modality; made once for each estimator."""
    folder, mark = DERIVED_DATA / "fusion", estimates_fingerprint("*", OURS.weights)[:8]
    recording, estimates = kept_recording(name, SECONDS, folder, sequences.OUR_SETUP), {}
    for modality in MODALITIES:
        table = folder / f"{name}-{modality}-{mark}.csv"
        if not table.exists():
            estimator = Estimator(recording.camera, modality=modality)
            write_estimates(list(estimate(recording, estimator, RATE_HZ)), table)
        estimates[modality] = read_estimates(table)
    return recording, estimates


def silenced(tracks: dict) -> dict:
    """The estimates with each modality's replaced by failures for a while."""

    def failed(modality, e):
        first_s, last_s = SILENT_S[modality]
        return replace(e, status=Status.NO_RING, T_cam_port=None) if first_s < e.t_us * 1e-6 < last_s else e

    return {modality: [failed(modality, e) for e in track] for modality, track in tracks.items()}


def errors(recording, estimates, port: Port) -> pd.DataFrame:
    """Squared Mahalanobis distances and log scores of the truth, and errors, of estimates with a pose."""
    known, truth = true_poses(recording, [e for e in estimates if e.T_cam_port is not None])
    T = Pose.stack([e.T_cam_port for e in known])
    d = pose_difference(T, truth, port.yaw_period_rad)
    C = np.array([e.covariance for e in known])
    nees = mahalanobis(d, C)
    return pd.DataFrame({"nees": nees, "score": log_scores(nees, C),
                         "in_view": in_view(truth, port, recording.camera),
                         "position_error_m": position_error_m(T, truth),
                         "normal_error_rad": normal_error_rad(T, truth)})  # fmt: skip


def right(table: pd.DataFrame) -> pd.Series:
    return (table.position_error_m < OURS.right_position_m) & (table.normal_error_rad < OURS.right_normal_rad)


def scored(cases, motion: MotionSettings, port: Port) -> pd.DataFrame:
    # every pose is scored, however doubtful
    settings = replace(OURS, motion=motion, min_fused_confidence=0.0)
    tables = [errors(recording, fuse(merge_by_time(tracks), port.yaw_period_rad, RATE_HZ, settings), port)
              .assign(sequence=recording.name) for recording, tracks in cases]  # fmt: skip
    return pd.concat(tables).query("in_view")


def choice(grid: pd.DataFrame) -> pd.Series:
    """The best score among the settings whose coverage is right; for want of them, the nearest to it."""
    off = (grid.inside_95_percent - 95).abs()
    calibrated = off <= np.maximum(grid.chance, off.min())
    return grid.loc[grid.score.where(calibrated).idxmax()]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--present", action="store_true", help="measure the present settings, choose none")
    args = parser.parse_args()
    port, plain = Port.lm_map(), [measured(name) for name in SEQUENCES]
    cases = plain + [(recording, silenced(tracks)) for recording, tracks in plain]
    if args.present:
        inside = 100 * (scored(cases, OURS.motion, port).nees < chi2.ppf(0.95, 6))
        values = {"inside_95_percent": float(inside.mean()), "poses": len(inside)}
        facts = {"command": "python tuning/tune_fusion.py --present", "sequences": SEQUENCES}
        print(save_json(DATA / "results" / "fusion" / "present.json", values, **facts).read_text())
        return
    steps = [np.diff(recording.truth.poses.position_m, axis=0) for recording, _ in plain]
    turns = [pose_difference(r.truth.poses[:-1], r.truth.poses[1:], np.pi)[:, 3:] for r, _ in plain]
    start = MotionSettings(
        speed_m_s=round(float(np.sqrt(np.mean(np.concatenate(steps) ** 2))) * sequences.TRUTH_HZ, 2),
        rate_rad_s=round(float(np.sqrt(np.mean(np.concatenate(turns) ** 2))) * sequences.TRUTH_HZ, 2),
        lost_s=LOST_S[0],
    )
    rows = []
    for values in tqdm(list(product(ACCELERATION_M, ACCELERATION_RAD, CORRELATION_S)), "grid"):
        names = ("acceleration_m", "acceleration_rad", "correlation_s")
        chosen = dict(zip(names, values, strict=True))
        table = scored(cases, replace(start, **chosen), port)
        inside = 100 * (table.nees < chi2.ppf(0.95, 6))
        rows.append({**chosen, "score": table.score.mean(), "inside_95_percent": inside.mean(),
                     "chance": inside.groupby(table.sequence).mean().sem(), "poses": len(table)})  # fmt: skip
    grid = pd.DataFrame(rows)
    best = choice(grid)
    motion = replace(start, **{name: float(best[name]) for name in names})

    silent = {s: scored(cases[len(plain) :], replace(motion, lost_s=s), port) for s in LOST_S}
    new = {s: len(table) - len(silent[LOST_S[0]]) for s, table in silent.items()}
    wrong = {s: int((~right(table)).sum() - (~right(silent[LOST_S[0]])).sum()) for s, table in silent.items()}
    lost_s = max(s for s in LOST_S if wrong[s] <= 0.05 * max(new[s], 1))

    alone = [(recording, track) for recording, tracks in plain for track in tracks.values()]
    judged = [pair for recording, track in alone for pair in _judged(recording, track, port)]
    kept, good = is_certain([e for e, _ in judged]), np.array([r for _, r in judged])
    choices = {
        "motion": {**motion.__dict__, "lost_s": lost_s},
        "inside_95_percent": float(best.inside_95_percent),
        "certain": {
            "of_right_percent": 100 * kept[good].mean(),
            "of_wrong_percent": 100 * kept[~good].mean(),
        },
        "coasting": {str(s): {"poses_more": new[s], "wrong_more": wrong[s]} for s in LOST_S},
    }
    facts = {"command": "python tuning/tune_fusion.py", "sequences": SEQUENCES, "seconds": SECONDS}
    save_table(DATA / "results" / "fusion" / "grid.csv", grid, **facts)
    print(save_json(DATA / "results" / "fusion" / "choices.json", choices, **facts).read_text())


def _judged(recording, estimates, port: Port):
    known = [e for e in true_poses(recording, estimates)[0] if e.T_cam_port is not None]
    return zip(known, right(errors(recording, known, port)), strict=True)


if __name__ == "__main__":
    main()
