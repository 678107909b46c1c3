"""The paper's comparison with visual odometry: relative position errors over parts of the path.

So far it holds our own estimates; the rows of EVO, ORB-SLAM3 and SVO say that they were not run yet.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from .core import Estimate, Port, Pose, Trajectory
from .geometry import rotation_z
from .metrics import relative_errors
from .results import DERIVED
from .tracking import outlier_filter
from .trajectories import read_estimates, read_trajectory, trajectory_of

LIGHTS, MODALITIES = ("low", "medium", "high"), ("rgb", "event")
FRACTIONS = (0.1, 0.2, 0.3, 0.4, 0.5)  # of the length of the camera's path
RIVALS = ("ORB-SLAM3", "SVO", "EVO")


def continuous_yaw(trajectory: Trajectory, period_rad: float) -> Trajectory:
    """The same poses with yaw's unknown multiple of ``period_rad`` chosen to follow the pose before.

    What remains is one multiple for the whole trajectory, which relative motion does not see.
    """
    R = trajectory.T_cam_port.rotation
    step = np.swapaxes(R[:-1], -1, -2) @ R[1:]
    # angle about z nearest to a rotation: the one that maximises trace(Rz(-a) step)
    angle = np.arctan2(step[:, 1, 0] - step[:, 0, 1], step[:, 0, 0] + step[:, 1, 1])
    turns = np.concatenate([np.zeros(min(len(R), 1)), np.cumsum(np.round(angle / period_rad))])
    rotation = R @ rotation_z(-period_rad * turns)
    return Trajectory(trajectory.t_us, Pose(rotation, trajectory.T_cam_port.position_m))


def camera_track(estimates: list[Estimate], port: Port) -> Trajectory:
    """What an odometry is compared with: the poses that pass the outlier filter, yaw continuous."""
    kept = outlier_filter(estimates, port.yaw_period_rad)
    found = [e for e, keep in zip(estimates, kept, strict=True) if keep and e.T_cam_port is not None]
    return continuous_yaw(trajectory_of(found), port.yaw_period_rad)


def path_length_m(trajectory: Trajectory) -> float:
    """Length of the camera's path in the port's frame."""
    steps = np.diff(trajectory.T_cam_port.inverse.position_m, axis=0)
    return float(np.linalg.norm(steps, axis=1).sum())


def errors(estimates: list[Estimate], truth: Trajectory, port: Port | None = None) -> pd.DataFrame:
    """One row per stretch of path: ``length_m``, relative ``position_error_m`` and ``rotation_error_deg``.

    Raises
    ------
    ValueError
        If too few estimates have a pose to find the scale.
    """
    lengths_m = path_length_m(truth) * np.array(FRACTIONS)
    found = relative_errors(camera_track(estimates, port or Port.lm_map()), truth, lengths_m)
    parts = [
        pd.DataFrame(
            {
                "length_m": e.length_m,
                "position_error_m": e.translation_m,
                "rotation_error_deg": np.rad2deg(e.rotation_rad),
            }
        )
        for e in found
    ]
    return pd.concat(parts, ignore_index=True)


def benchmark(profile: str = "quick") -> pd.DataFrame:
    """Errors of every test sequence and modality, one row per stretch, from the accuracy study's files.

    Where the metric is not defined (too few poses) there is one row whose ``outcome`` says so.
    """
    tables, folder = [], DERIVED / profile
    for light in LIGHTS:
        truth = read_trajectory(folder / f"test-{light}.truth.csv")
        for modality in MODALITIES:
            estimates = read_estimates(folder / f"estimates-test-{light}-{modality}.csv")
            try:
                table = errors(estimates, truth).assign(outcome="tracked")
            except ValueError:
                table = pd.DataFrame({"outcome": ["too few poses"]})
            tables.append(table.assign(method="lmmap", light=light, modality=modality))
    return pd.concat(tables, ignore_index=True)


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Number, median and quartiles of `benchmark` over all lengths, and the methods not run yet."""
    keys = ["method", "light", "modality", "outcome"]
    described = table.groupby(keys).position_error_m.describe()[["count", "25%", "50%", "75%"]]
    ours = described.set_axis(["stretches", "quartile_1_m", "median_m", "quartile_3_m"], axis=1).reset_index()
    rivals = pd.DataFrame({"method": RIVALS, "outcome": "not run yet"})
    return pd.concat([ours, rivals], ignore_index=True)
