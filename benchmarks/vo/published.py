"""The committed tracks, truth and run log of `make vo`, in data/results/odometry."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd

from lmmap.recordings.pose_files import read_trajectory, write_trajectory
from lmmap.types import InputError, Trajectory
from lmmap_lab.provenance import save_table
from lmmap_lab.studies import odometry

TRUTH_HZ = 20  # the motion is slow: interpolating this is exact to 0.02 mm


def publish(rows: list[dict], folder: Path, facts: dict, kept_rows: list[dict],
            methods: tuple[str, ...]) -> None:  # fmt: skip
    """Copy tracks and truth to data/results/odometry, with the log; tracks not in ``kept_rows`` go."""
    target = odometry.FOLDER
    target.mkdir(parents=True, exist_ok=True)
    users = {f"EVO-event-{name}.tum" for name in odometry.SEQUENCES}  # of another EVO, put there by a user
    for old in target.glob("*.tum"):
        if old.name not in {*(row["file"] for row in kept_rows), *users}:
            old.unlink()
    for name in odometry.SEQUENCES:
        truth = read_trajectory(folder / f"{name}.truth.csv")
        every = max(1, round(len(truth) / (truth.t_us[-1] - truth.t_us[0]) * 1e6 / TRUTH_HZ))
        at = sorted({*range(0, len(truth), every), len(truth) - 1})
        write_trajectory(Trajectory(truth.t_us[at], truth.poses[at]), target / f"truth-{name}.tum", "tum")
    for row in rows:
        lines = (folder / "tracks" / row["file"]).read_text().splitlines()
        (target / row["file"]).write_text("".join(_short(line) + "\n" for line in lines))
    table = pd.DataFrame(kept_rows + rows)
    table = table.sort_values("method", key=lambda m: m.map(methods.index), kind="stable")
    save_table(target / "runs.csv", table, **facts)


def _short(line: str) -> str:
    if line.startswith("#"):
        return line
    time, *pose = line.split()
    return " ".join([time, *(f"{float(v):.6f}" for v in pose)])


def kept_rows(methods: list[str], facts: dict) -> tuple[list[dict], dict]:
    """Committed rows of all other methods, and the facts with the commits that made them.

    Raises
    ------
    InputError
        If the committed rows are of another profile: runs of different lengths do not compare.
    """
    log = pd.read_csv(odometry.FOLDER / "runs.csv")
    before = json.loads((odometry.FOLDER / "runs.provenance.json").read_text())
    if before["profile"] != facts["profile"]:
        raise InputError(
            f"{odometry.FOLDER / 'runs.csv'}: its runs are of the profile {before['profile']}, not of "
            f"{facts['profile']}; set PROFILE, or run all methods"
        )
    inherited = {key: before[key] for key in ("vocabulary_sha256", "pins", "commits") if key in before}
    return log[~log.method.isin(methods)].to_dict("records"), facts | inherited
