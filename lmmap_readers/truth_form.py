"""Whether a truth was written in another form than it is read in, one that would remove a constant error."""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from lmmap.evaluation.pose_errors import position_error_m, rotation_error_rad
from lmmap.settings import OURS
from lmmap.types import Estimate, InputError, Pose, Trajectory

from .time_units import likely_units

FEWEST = 5  # poses to judge by
LIKELY_STEP_S = (1e-4, 1.0)  # between the poses of a truth: outside, its unit of time is another
MAX_STEP_S = 3.0  # beyond, straight lines between poses are no truth


def other(estimates: list[Estimate], truth: Trajectory, yaw_period_rad: float) -> str | None:
    """The form of the truth with which most estimates agree, in words; None if it is the one that was read,
    or if no form fits."""
    times_us = np.array([e.t_us for e in estimates], np.int64)
    posed = truth.covers(times_us) & np.array([e.T_cam_port is not None for e in estimates], bool)
    if np.sum(posed) < FEWEST:
        return None
    poses = Pose.stack(
        [T for e, known in zip(estimates, posed, strict=True) if known and (T := e.T_cam_port) is not None]
    )

    def errors(form: Pose) -> tuple[float, float]:
        T = Trajectory(truth.t_us, form).at(times_us[posed])
        off_m, off_rad = position_error_m(poses, T), rotation_error_rad(poses, T, yaw_period_rad)
        return float(np.median(off_m)), float(np.median(off_rad))

    def agree(off: tuple[float, float]) -> bool:
        return off[0] < OURS.right_position_m and off[1] < OURS.right_rotation_rad

    found = errors(truth.poses)
    if agree(found):
        return None
    for words, form in _forms(truth.poses):
        if agree(off := errors(form)):
            return f"{_said(found)} off throughout; {words}, it is {_said(off)}"
    return None


def _said(off: tuple[float, float]) -> str:
    return f"{1e3 * off[0]:.4g} mm and {np.rad2deg(off[1]):.0f} deg"


def _forms(T: Pose) -> Iterator[tuple[str, Pose]]:
    """Poses as they would be in other forms, those with fewer differences first."""
    turned = [("read with w first in its quaternions", _w_first(T)),
              ("read with w first in its quaternions", _w_first(T.inverse).inverse),
              ("inverted", T.inverse), ("inverted and read with w first", _w_first(T).inverse),
              ("inverted and read with w first", _w_first(T.inverse))]  # fmt: skip
    yield "taken as millimetres", _millimetres(T)
    yield from turned
    yield from ((f"{words} and taken as millimetres", _millimetres(form)) for words, form in turned)


def _w_first(T: Pose) -> Pose:
    """Poses whose quaternions (w, x, y, z) were read as (x, y, z, w)."""
    return Pose(Rotation.from_quat(np.roll(T.quaternion_xyzw, -1, -1)).as_matrix(), T.position_m)


def _millimetres(T: Pose) -> Pose:
    return Pose(T.rotation, 1e-3 * T.position_m)


def check_step(path, step_s: float, own: str) -> None:
    """Raise `InputError`, or warn, if a truth's poses are so far apart that its times have another unit."""
    least_s, most_s = LIKELY_STEP_S
    if least_s <= step_s < most_s:
        return
    likely = likely_units(step_s, own, least_s, most_s)
    found = f"its poses are {step_s:.3g} s apart, with times in {own}"
    remedy = f"if they are in {likely or 'another unit'}, write them in {own}"
    if not least_s <= step_s < MAX_STEP_S:
        raise InputError(f"{path}: {found}; {remedy}")
    warnings.warn(f"{path}: {found}, interpolated between them; {remedy}", stacklevel=3)
