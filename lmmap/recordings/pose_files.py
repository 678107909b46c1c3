"""Trajectories and estimates as text files, written whole or not at all.

CSV holds ``T_cam_port`` with ``t_us,x_m,y_m,z_m,qx,qy,qz,qw``; TUM holds, as its tools expect, the
camera's pose in the port's frame with times in seconds.
"""

from __future__ import annotations

import csv
import io
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
from scipy.spatial.transform import Rotation

from .. import plugins
from ..files import atomic, read_text
from ..types import Ellipse, Estimate, InputError, Pose, Status, Trajectory, checked
from .columns import CERTAINTY, COLUMNS, COVARIANCE, ELLIPSE, OUTSIDE, POSE, PREFIXES, SCORES, UPPER
from .limits import MAX_ESTIMATES_BYTES, MAX_POSITION_M, MAX_TRUTH_BYTES, check_times


def write_trajectory(trajectory: Trajectory, path, format: str = "csv") -> None:
    """Write ``csv`` (T_cam_port, microseconds) or ``tum`` (camera in the port's frame, seconds).

    Raises
    ------
    InputError
        If the file cannot be written.
    ValueError
        If ``format`` is neither of the two.
    """
    if format not in ("csv", "tum"):
        raise ValueError(f"format: expected 'csv' or 'tum', got {format!r}")
    T = trajectory.poses if format == "csv" else trajectory.poses.inverse
    rows = zip(trajectory.t_us.tolist(), _pose_rows(T), strict=True)
    with atomic(path) as temporary, temporary.open("w", newline="") as file:
        if format == "csv":
            csv.writer(file, lineterminator="\n").writerows(
                [("t_us", *POSE), *((t_us, *pose) for t_us, pose in rows)]
            )
        else:
            file.writelines(_tum_line(t_us, pose) for t_us, pose in rows)


def tum_line(t_us: int, T_cam_port: Pose) -> str:
    """One pose as a line of TUM, as `write_trajectory` writes it."""
    return _tum_line(int(t_us), _pose_rows(T_cam_port.inverse[None])[0])


def _tum_line(t_us: int, pose: list[str]) -> str:
    return f"{t_us // 10**6}.{t_us % 10**6:06d} {' '.join(pose)}\n"


def read_trajectory(path, format: str | None = None) -> Trajectory:
    """Read what `write_trajectory` wrote; raises `InputError`.

    By default a file is TUM if its name ends in .txt or .tum or its lines have eight words, unless it begins
    like our CSV.  From a table of estimates, take the poses that are ``ok``.
    """
    text = read_text(path, MAX_TRUTH_BYTES)
    return parse_trajectory(text, path, format or _format_of(text, Path(path)))


def _format_of(text: str, path: Path) -> str:
    """As it begins, else as its name ends: a table of either kind may have any name."""
    if text.startswith("t_us,"):
        return "csv"
    words = next((line for line in text.splitlines() if line.strip() and line[0] != "#"), "").split()
    return "tum" if path.suffix in (".txt", ".tum") or len(words) == 8 else "csv"


def parse_trajectory(text: str, path, format: str) -> Trajectory:
    """Parse the trajectory in a file's text; raises an `InputError` that names ``path``."""
    try:
        if format == "tum":
            lines = [line.split() for line in text.splitlines()]
            rows: list = [line for line in lines if line and not line[0].startswith("#")]
            t_us: Any = [round(float(row[0]) * 1e6) for row in rows]
            T = _poses([row[1:8] for row in rows]).inverse
        else:
            rows = [r for r in _csv_rows(text, ("t_us", *POSE)) if r.get("status", Status.OK) == Status.OK]
            t_us = [int(row["t_us"]) for row in rows]
            T = _poses([[row[name] for name in POSE] for row in rows])
        for time_us in t_us:
            check_times(time_us)
        return Trajectory(t_us, T)
    except (ValueError, IndexError, OverflowError, csv.Error) as error:
        form = "TUM lines" if format == "tum" else f"CSV with t_us,{','.join(POSE)}"
        raise InputError(f"{path}: not a trajectory ({_first_line(error)}); expected {form}") from None


def read_truth(path) -> Trajectory:
    """Read a ground truth: as `read_trajectory`, with at least two poses at plausible intervals.

    A warning says what is doubtful; raises `InputError`.
    """
    text = read_text(path, MAX_TRUTH_BYTES)
    form = _format_of(text, Path(path))
    trajectory = parse_trajectory(text, path, form)
    if len(trajectory) < 2:
        raise InputError(f"{path}: expected two poses or more, got {len(trajectory)}; give another truth")
    if check_step := plugins.reader("truth_step"):  # whether another program wrote times of another unit
        check_step(path, float(np.median(np.diff(trajectory.t_us))) * 1e-6, "us" if form == "csv" else "s")
    if form == "csv" and "status" in text.partition("\n")[0].split(","):
        warnings.warn(f"{path}: is a table of estimates; its ok poses are taken as the truth", stacklevel=2)
    return trajectory


@checked
def write_estimates(estimates: Sequence[Estimate], path: str | Path) -> None:
    """Write one line per estimate: time, status, pose, scores, ellipse, the rival's pose and that of the
    printed formula, certainty, and the upper triangle of the pose's covariance.  Raises `InputError`.

    Examples
    --------
    >>> lmmap.write_estimates([lmmap.Estimate(8000, lmmap.Status.NO_RING)], folder / "poses.csv")
    >>> lmmap.read_estimates(folder / "poses.csv")[0].status
    <Status.NO_RING: 'no_ring'>
    """
    with atomic(path) as temporary, temporary.open("w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(as_row(e) for e in estimates)


def as_row(e: Estimate) -> dict:
    """The line of an estimate, by `COLUMNS`; what the estimate does not have is absent."""
    row = {"t_us": int(e.t_us), "status": str(e.status)}
    row |= {name: f"{getattr(e, name):.6g}" for name in (*SCORES, *CERTAINTY)}
    row[OUTSIDE] = int(e.outside_training)
    if e.covariance is not None:
        row |= {n: f"{v:.9g}" for n, v in zip(COVARIANCE, e.covariance[UPPER], strict=True)}
    if e.ellipse is not None:
        values = np.r_[e.ellipse.centre_px, e.ellipse.semi_axes_px, e.ellipse.angle_rad]
        row |= {name: f"{v:.6f}" for name, v in zip(ELLIPSE, values, strict=True)}
    for name, prefix in PREFIXES.items():
        if (T := getattr(e, name)) is not None:
            row |= {prefix + n: v for n, v in zip(POSE, _pose_rows(T[None])[0], strict=True)}
    return row


def round_trip(e: Estimate) -> Estimate:
    """The estimate after a round trip through its CSV row."""
    return _estimate(as_row(e))


@checked
def read_estimates(path: str | Path) -> list[Estimate]:
    """Read what `write_estimates` wrote; raises `InputError`.

    Examples
    --------
    >>> lmmap.write_estimates([], folder / "none.csv")
    >>> lmmap.read_estimates(folder / "none.csv")
    []
    """
    return parse_estimates(read_text(path, MAX_ESTIMATES_BYTES), path)


def parse_estimates(text: str, path) -> list[Estimate]:
    """Parse the estimates in a file's text; raises an `InputError` that names ``path``."""
    try:
        return [_estimate(row) for row in _csv_rows(text, ("t_us", "status", *POSE, *SCORES))]
    except (ValueError, KeyError, TypeError, OverflowError, csv.Error) as error:
        raise InputError(
            f"{path}: not a table of estimates ({_first_line(error)}); write it with lmmap estimate"
        ) from None


def _estimate(row: dict) -> Estimate:
    row = {name.replace("paper_", "printed_"): value for name, value in row.items()}  # an older name
    poses: dict[str, Any] = {
        name: _poses([[row[prefix + n] for n in POSE]])[0]
        for name, prefix in PREFIXES.items()
        if row.get(prefix + "x_m")
    }
    ellipse = None
    if row.get("u_px"):
        u, v, major, minor, angle = (float(row[n]) for n in ELLIPSE)
        ellipse = cast(Callable, Ellipse)([u, v], [major, minor], angle)
    scores: dict[str, Any] = {name: float(row[name]) for name in SCORES}
    scores |= {name: float(row[name]) for name in CERTAINTY if row.get(name)}  # newer than the rest
    covariance = None
    if row.get(COVARIANCE[0]):
        covariance = np.zeros((6, 6))
        covariance[UPPER] = covariance.T[UPPER] = [float(row[n]) for n in COVARIANCE]
    return Estimate(int(row["t_us"]), Status(row["status"]), ellipse=ellipse, covariance=covariance,
                    outside_training=row.get(OUTSIDE) == "1", **poses, **scores)  # fmt: skip


def trajectory_of(estimates: list[Estimate]) -> Trajectory:
    """The estimates that have a pose, as a trajectory."""
    posed = [e for e in estimates if e.T_cam_port is not None]
    return Trajectory(cast(np.ndarray, [e.t_us for e in posed]), Pose.stack([e.T_cam_port for e in posed]))


def _csv_rows(text: str, columns) -> list[dict]:
    reader = csv.DictReader(io.StringIO(text, newline=""), strict=True)
    if missing := [c for c in columns if c not in (reader.fieldnames or ())]:
        raise ValueError(f"no column {', '.join(missing)}")
    rows = list(reader)
    if any(None in row or None in row.values() for row in rows):
        raise ValueError("lines of different length")
    return rows


def _pose_rows(T: Pose) -> list[list[str]]:
    values = np.concatenate([T.position_m, T.quaternion_xyzw.reshape(-1, 4)], -1)
    return [[f"{v:.12g}" for v in row] for row in values]


def _poses(rows) -> Pose:
    """Poses of rows x, y, z, qx, qy, qz, qw; ValueError where they are none."""
    values = np.array(rows, float).reshape(-1, 7)
    if not np.all(np.isfinite(values)):
        raise ValueError("a value is not finite")
    if np.any(np.abs(values[:, :3]) > MAX_POSITION_M):
        raise ValueError(f"a position beyond {MAX_POSITION_M:g} m")
    norm = np.linalg.norm(values[:, 3:].clip(-2, 2), axis=1)  # the squares of larger ones may not be finite
    if np.any(np.abs(norm - 1) > 1e-3):
        raise ValueError("a quaternion is not of unit length")
    return Pose(Rotation.from_quat(values[:, 3:]).as_matrix().reshape(-1, 3, 3), values[:, :3])


def _first_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0][:200]
