"""Whether one and the same rotation lies between poses and their truth, in every recording.

If the port is askew on the arm, there is one in the port's frame; if the hand-eye calibration is, one in the
camera's.  A formula's errors lean to where the ring leans, so no rotation takes them away.  A port's place on
the arm that was calibrated on the same poses is never askew to them; then only the camera's is tested.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from lmmap.evaluation.pose_errors import normal_error_rad, pose_difference
from lmmap.settings import PAPER
from lmmap.types import Pose

from . import bootstrap
from .table1 import bootstrap_counts

FRAMES = ("port", "camera")
EXPLAINS = 0.5  # share of the median error that a rotation must take away to be the reason
DRAWS, LEAST_POSES = 200, 20


def rotations_rad(poses: Pose, truth: Pose, frame: str, yaw_period_rad: float) -> np.ndarray:
    """Rotation vectors (N, 3) from poses to truths, along the axes of one of `FRAMES`."""
    left = pose_difference(poses, truth, yaw_period_rad)[:, 3:]
    return left if frame == "camera" else np.einsum("nji,nj->ni", truth.rotation, left)


def without(truth: Pose, rotation_rad, frame: str) -> Pose:
    """Truths (N,) without a misalignment."""
    back = Rotation.from_rotvec(-np.asarray(rotation_rad)).as_matrix()
    rotation = truth.rotation @ back if frame == "port" else back @ truth.rotation
    return Pose(rotation, truth.position_m)


def misalignment(recordings: Mapping[str, tuple[Pose, Pose]], yaw_period_rad: float,
                 rate_hz: float = PAPER.rate_hz) -> pd.DataFrame:  # fmt: skip
    """The rotation of each recording, and what the others' rotation leaves of its normals' errors.

    Parameters
    ----------
    recordings
        Poses (N,) and truths (N,) of the same images, in the order of time.  A single one is cut in half.

    Returns
    -------
    DataFrame
        A row for each recording of `LEAST_POSES` poses or more, and each of `FRAMES`: the rotation's medians
        ``x_deg, y_deg, z_deg``; ``within_deg``, half of the widest of their 95 % intervals; ``normal_deg``,
        the normals' median error; and ``left_deg``, that without the mean rotation of the other recordings.
    """
    enough = {name: pair for name, pair in recordings.items() if len(pair[0]) >= LEAST_POSES}
    if len(enough) == 1:
        ((name, (poses, truth)),) = enough.items()
        middle = len(poses) // 2
        enough = {f"{name}, first half": (poses[:middle], truth[:middle]),
                  f"{name}, second half": (poses[middle:], truth[middle:])}  # fmt: skip
    rows = []
    for frame in FRAMES:
        medians, within = {}, {}
        for name, (poses, truth) in enough.items():
            vectors = rotations_rad(poses, truth, frame, yaw_period_rad)
            counts = bootstrap_counts([len(vectors)], DRAWS, 0, rate_hz)
            medians[name] = np.median(vectors, 0)
            within[name] = max(
                np.diff(bootstrap.interval(bootstrap.medians(v, counts)))[0] / 2 for v in vectors.T
            )
        for name, (poses, truth) in enough.items():
            others = np.mean([m for other, m in medians.items() if other != name], 0)
            off = [np.median(normal_error_rad(poses, T)) for T in (truth, without(truth, others, frame))]
            values = np.rad2deg([*medians[name], within[name], *off])
            rows.append((name, frame, len(poses), *values))
    columns = [
        "recording",
        "frame",
        "poses",
        "x_deg",
        "y_deg",
        "z_deg",
        "within_deg",
        "normal_deg",
        "left_deg",
    ]
    return pd.DataFrame(rows, columns=columns)


def verdict(table: pd.DataFrame) -> str:
    """What a table of `misalignment` says, in a line."""
    if not len(table):
        return "too few poses to tell a misaligned truth"
    frame = table.groupby("frame").left_deg.median().idxmin()
    rows = table[table.frame == frame]
    axes = rows[["x_deg", "y_deg", "z_deg"]].mean()
    before, after = rows.normal_deg.median(), rows.left_deg.median()
    angle = f"one rotation of {np.linalg.norm(axes):.2f} deg in the {frame}'s frame"
    if (rows.left_deg < (1 - EXPLAINS) * rows.normal_deg).all():
        return f"misaligned truth: {angle} takes the normals' error from {before:.2f} to {after:.2f} deg"
    return f"no misaligned truth: {angle} leaves {after:.2f} of {before:.2f} deg"
