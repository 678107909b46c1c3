"""The paper's comparison with visual odometry: relative position errors over parts of the path.

Trajectories are files: ours and those that ``make vo`` lets ORB-SLAM3, SVO and EVO write lie in
``data/results/odometry``, with the log of the runs; that of another EVO, if a user has one, goes there too.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pandas as pd

from lmmap.geometry.rotations import equal_turns, rotation_angle_rad, rotation_z
from lmmap.recordings.pose_files import read_trajectory, trajectory_of
from lmmap.settings import MODALITIES
from lmmap.tracking.outliers import outlier_filter
from lmmap.types import Estimate, InputError, Port, Pose, Trajectory

from ..provenance import DATA
from .trajectory_errors import relative_errors

FOLDER = DATA / "results" / "odometry"
SEQUENCES = ("test-high", "realistic-5")  # high light: the unseen test, and one of training
METHODS = ("lmmap", "ORB-SLAM3", "SVO")
FRACTIONS = (0.1, 0.2, 0.3, 0.4, 0.5)  # of the length of the camera's path
ALIGNED_POSES = 40  # the paper's: the first of a track fix its scale
COUNTS = ["frames", "initialising", "tracked", "lost", "resets", "tracks"]


class NotScored(ValueError):
    """A trajectory on which the metric is not defined; the message says why, and the remedy."""


def continuous_yaw(trajectory: Trajectory, period_rad: float) -> Trajectory:
    """The same poses, each with the multiple of ``period_rad`` in yaw that is nearest to the pose before.

    What remains is one multiple for the whole trajectory, which relative motion does not see.
    """
    R = trajectory.poses.rotation
    step = np.swapaxes(R[:-1], -1, -2) @ R[1:]
    # angle about z nearest to a rotation: the one that maximises trace(Rz(-a) step)
    angle = np.arctan2(step[:, 1, 0] - step[:, 0, 1], step[:, 0, 0] + step[:, 1, 1])
    turns = np.concatenate([np.zeros(min(len(R), 1)), np.cumsum(np.round(angle / period_rad))])
    rotation = R @ rotation_z(-period_rad * turns)
    return Trajectory(trajectory.t_us, Pose(rotation, trajectory.poses.position_m))


def nearest_yaw(trajectory: Trajectory, reference: Trajectory, period_rad: float) -> Trajectory:
    """Poses within a reference's time, with the multiple of ``period_rad`` in yaw that is nearest to it."""
    within = (trajectory.t_us >= reference.t_us[0]) & (trajectory.t_us <= reference.t_us[-1])
    T, t_us = trajectory.poses[within], trajectory.t_us[within]
    equal = T.rotation[:, None] @ equal_turns(period_rad)
    off_rad = rotation_angle_rad(np.swapaxes(reference.at(t_us).rotation, -1, -2)[:, None] @ equal)
    return Trajectory(t_us, Pose(equal[np.arange(len(t_us)), np.argmin(off_rad, 1)], T.position_m))


def camera_track(estimates: list[Estimate], port: Port) -> Trajectory:
    """Our track for the comparison: the poses that pass the outlier filter, with continuous yaw."""
    kept = outlier_filter(estimates, port.yaw_period_rad)
    filtered = [e for e, keep in zip(estimates, kept, strict=True) if keep and e.T_cam_port is not None]
    return continuous_yaw(trajectory_of(filtered), port.yaw_period_rad)


def path_length_m(trajectory: Trajectory) -> float:
    """Length of the camera's path in the port's frame."""
    steps = np.diff(trajectory.poses.inverse.position_m, axis=0)
    return float(np.linalg.norm(steps, axis=1).sum())


def read_tracks(path) -> list[Trajectory]:
    """Trajectories of a file, cut at its ``# track`` lines, where a new map with its own scale begins.

    Raises
    ------
    InputError
        If the file holds no trajectory.
    """
    whole = read_trajectory(path)
    lines = [line.strip() for line in Path(path).read_text().splitlines()]
    lines = [line for line in lines if line.startswith("# track") or (line and line[0] != "#")]
    if Path(path).suffix == ".csv" or not any(line.startswith("# track") for line in lines):
        return [whole] if len(whole) else []
    sizes = [
        len(list(g)) for is_cut, g in itertools.groupby(lines, lambda x: x.startswith("# ")) if not is_cut
    ]
    stops = np.cumsum([0, *sizes])
    return [Trajectory(whole.t_us[a:b], whole.poses[a:b]) for a, b in itertools.pairwise(stops.tolist())]


def score(tracks: list[Trajectory], reference: Trajectory) -> pd.DataFrame:
    """One row per stretch: ``track``, ``length_m``, ``position_error_m``, ``rotation_error_deg``.

    Each track is scaled by its own first `ALIGNED_POSES` poses.  The reference is interpolated at the
    track's times, so that its rate does not matter.  Lengths are `FRACTIONS` of the reference's path.

    Raises
    ------
    NotScored
        If no track has a single stretch to compare, with the reason of the last one.
    """
    if not len(reference):
        raise NotScored("nothing to compare with: the reference holds no pose")
    lengths_m = path_length_m(reference) * np.array(FRACTIONS)
    parts, reason = [], "holds no pose; let the odometry track something first"
    for number, track in enumerate(tracks):
        try:
            parts.append(_score(track, reference, lengths_m).assign(track=number))
        except NotScored as error:
            reason = str(error)
    if not parts:
        raise NotScored(reason)
    return pd.concat(parts, ignore_index=True)


def _score(track: Trajectory, reference: Trajectory, lengths_m) -> pd.DataFrame:
    span = reference.t_us[[0, -1]]
    inside = reference.covers(track.t_us)
    if not inside.any():
        had, wanted = track.t_us[[0, -1]] * 1e-6, span * 1e-6
        raise NotScored(
            f"its times ({had[0]:.3f} to {had[1]:.3f} s) are outside the reference's ({wanted[0]:.3f} to "
            f"{wanted[1]:.3f} s); write the recording's own times"
        )
    if inside.sum() < ALIGNED_POSES:
        raise NotScored(
            f"too short: {inside.sum()} poses within the reference's time, and finding the scale takes the "
            f"first {ALIGNED_POSES}; track for longer"
        )
    track = Trajectory(track.t_us[inside], track.poses[inside])
    at = Trajectory(track.t_us, reference.at(track.t_us))
    try:
        errors = relative_errors(track, at, lengths_m, aligned_poses=ALIGNED_POSES)
    except ValueError:
        raise NotScored(
            f"its first {ALIGNED_POSES} positions lie on a line, which leaves the scale open; "
            "start where the camera moves"
        ) from None
    if not any(e.translation_m.size for e in errors):
        raise NotScored(f"too short: no stretch of path reaches {lengths_m[0]:.2f} m; track for longer")
    return pd.concat(
        pd.DataFrame({"length_m": e.length_m, "position_error_m": e.translation_m,
                      "rotation_error_deg": np.rad2deg(e.rotation_rad)}) for e in errors
    )  # fmt: skip


def by_length(table: pd.DataFrame) -> pd.DataFrame:
    """Number of stretches and median errors for each length."""
    groups = table.groupby("length_m")
    medians = groups[["position_error_m", "rotation_error_deg"]].median()
    medians.columns = ["median_m", "rotation_median_deg"]
    return medians.assign(stretches=groups.size()).reset_index()


def runs(folder: Path = FOLDER) -> pd.DataFrame:
    """The log of all runs, one row each, and one for each trajectory of EVO that a user has put there."""
    log = pd.read_csv(folder / "runs.csv")
    evo = [
        {"method": "EVO", "modality": "event", "sequence": s, "run": 0, "start_s": 0.0,
         "outcome": "finished", "file": f"EVO-event-{s}.tum"}
        for s in SEQUENCES if (folder / f"EVO-event-{s}.tum").exists()
    ]  # fmt: skip
    return pd.concat([log, pd.DataFrame(evo)], ignore_index=True) if evo else log


def benchmark(folder: Path = FOLDER) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Every run, with ``scored`` true or the reason why not; and all stretches of the scored ones."""
    log, tables = runs(folder), []
    references = {name: read_trajectory(folder / f"truth-{name}.tum") for name in SEQUENCES}
    keys = ["method", "modality", "sequence", "run", "start_s"]
    reasons = []
    for run in log.to_dict("records"):
        try:
            table = score(read_tracks(folder / run["file"]), references[run["sequence"]])
            tables.append(table.assign(**{key: run[key] for key in keys}))
            reasons.append("")
        except (NotScored, InputError) as error:
            reasons.append(str(error))
    return log.assign(not_scored=reasons), pd.concat(tables, ignore_index=True)


def summary(log: pd.DataFrame, table: pd.DataFrame) -> pd.DataFrame:
    """One row per method, modality and sequence: runs, failures, tracking, and errors over all lengths.

    ``failed`` runs crashed or timed out; ``scored`` ones have at least one stretch to compare.
    EVO has its row even where nobody has run it.
    """
    keys = ["sequence", "method", "modality"]
    groups = log.groupby(keys)
    sums = groups[COUNTS].sum()
    rows = pd.DataFrame({
        "runs": groups.size(),
        "failed": groups.outcome.agg(lambda o: int((o != "finished").sum())),
        "scored": groups.not_scored.agg(lambda r: int((r == "").sum())),
        "tracked_percent": 100 * sums.tracked / sums.frames,
        "lost_percent": 100 * sums.lost / sums.frames,
        "resets_per_run": groups.resets.mean(),
    })  # fmt: skip
    errors = table.groupby(keys).position_error_m.describe()[["count", "25%", "50%", "75%"]]
    errors.columns = ["stretches", "quartile_1_m", "median_m", "quartile_3_m"]
    per_run = table.groupby([*keys, "run"]).position_error_m.median()
    errors["best_run_m"] = per_run.groupby(keys).min()
    everything = itertools.product(SEQUENCES, METHODS, MODALITIES)
    index = pd.MultiIndex.from_tuples([*everything, *((s, "EVO", "event") for s in SEQUENCES)], names=keys)
    rows = rows.join(errors, how="left").reindex(index).reset_index()
    return rows.assign(outcome=np.where(rows.runs.isna(), "not run here", "run"))
