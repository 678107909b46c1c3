"""Rigid transforms, and a sequence of them over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation, Slerp

from .arrays import frozen_numbers
from .checks import check_fields, checked, frozen_times


@dataclass(frozen=True)
class Pose:
    """Rigid transforms ``T_a_b``: ``rotation (..., 3, 3)`` and ``position_m (..., 3)``.

    Raises
    ------
    ValueError
        If either has another shape or does not hold numbers.

    Examples
    --------
    A transform maps points from frame b to frame a; composed with its inverse, it is the identity:

    >>> T_cam_port = lmmap.Pose(np.diag([1.0, -1.0, -1.0]), [0.0, 0.0, 0.6])
    >>> T_cam_port @ np.array([0.1, 0.0, 0.0])
    array([0.1, 0. , 0.6])
    >>> (T_cam_port @ T_cam_port.inverse).position_m
    array([0., 0., 0.])
    """

    rotation: np.ndarray
    position_m: np.ndarray

    def __post_init__(self):
        object.__setattr__(self, "rotation", frozen_numbers("rotation", self.rotation, 3, 3))
        object.__setattr__(self, "position_m", frozen_numbers("position_m", self.position_m, 3))

    @classmethod
    def identity(cls) -> Pose:
        """The transform that changes nothing."""
        return cls(np.eye(3), np.zeros(3))

    @classmethod
    @checked
    def stack(cls, poses: Sequence[Pose]) -> Pose:
        """Join poses of any shapes, or none at all, into one of shape (N,)."""
        rotation = [np.empty((0, 3, 3)), *(T.rotation.reshape(-1, 3, 3) for T in poses)]
        position_m = [np.empty((0, 3)), *(T.position_m.reshape(-1, 3) for T in poses)]
        return cls(np.concatenate(rotation), np.concatenate(position_m))

    def __matmul__(self, other):
        """``T_a_b @ T_b_c -> T_a_c`` and ``T_a_b @ p_b -> p_a`` for points of shape (..., 3)."""
        if isinstance(other, Pose):
            return Pose(self.rotation @ other.rotation, self @ other.position_m)
        return np.einsum("...ij,...j->...i", self.rotation, other) + self.position_m

    def __getitem__(self, index) -> Pose:
        return Pose(self.rotation[index], self.position_m[index])

    def __len__(self) -> int:
        return len(self.position_m)

    @property
    def inverse(self) -> Pose:
        """``T_b_a`` of ``T_a_b``."""
        rotation = np.swapaxes(self.rotation, -1, -2)
        return Pose(rotation, -np.einsum("...ij,...j->...i", rotation, self.position_m))

    @property
    def normal(self) -> np.ndarray:
        """The b-frame's z axis in a, shape (..., 3): the port's normal for ``T_cam_port``."""
        return self.rotation[..., :, 2]

    @property
    def quaternion_xyzw(self) -> np.ndarray:
        """Unit quaternions of the rotations, shape (..., 4), scalar last and not negative."""
        return Rotation.from_matrix(self.rotation).as_quat(canonical=True)


GAP_STEPS, GAP_US = 10, 100_000  # a gap is longer than this many usual steps, and than this time


@dataclass(frozen=True)
class Trajectory:
    """Poses ``T_a_b`` of one frame in another at strictly increasing times ``t_us (N,)``.

    The context says which frames: ``T_cam_port`` for a recording's truth and for estimates, ``T_root_tip``
    for an arm.

    Raises
    ------
    ValueError
        If there are not as many times as poses, or the times do not increase strictly.

    Examples
    --------
    >>> T = lmmap.Pose(np.tile(np.eye(3), (2, 1, 1)), [[0.0, 0.0, 0.6], [0.1, 0.0, 0.6]])
    >>> lmmap.Trajectory([0, 100_000], T).at(25_000).position_m
    array([0.025, 0.   , 0.6  ])
    """

    t_us: np.ndarray
    poses: Pose

    def __post_init__(self):
        object.__setattr__(self, "t_us", frozen_times("Trajectory: t_us", self.t_us))
        check_fields(self)
        if self.t_us.shape != self.poses.position_m.shape[:-1] or self.t_us.ndim != 1:
            shapes = f"{self.t_us.shape} and {self.poses.position_m.shape[:-1]}"
            raise ValueError(f"t_us, poses: expected as many times as poses (N,), got {shapes}")
        if np.any(np.diff(self.t_us) <= 0):
            raise ValueError("t_us: expected times that increase strictly, got others")

    def __len__(self) -> int:
        return len(self.t_us)

    @checked
    def covers(self, t_us: ArrayLike) -> np.ndarray:
        """Which times (...) in microseconds lie inside the trajectory but not in a gap, that is, a step of
        more than `GAP_STEPS` times the median one and of more than `GAP_US`."""
        t, steps = np.asarray(t_us), np.diff(self.t_us)
        if not len(steps):
            return np.isin(t, self.t_us)
        after = np.clip(np.searchsorted(self.t_us, t), 1, len(steps))
        known = steps[after - 1] <= max(GAP_STEPS * np.median(steps), GAP_US)
        return (t >= self.t_us[0]) & (t <= self.t_us[-1]) & (known | np.isin(t, self.t_us))

    @checked
    def at(self, t_us: ArrayLike, *, across_gaps: bool = False) -> Pose:
        """Interpolate poses (linear, slerp) at one time or times (N,) in microseconds.

        Raises
        ------
        ValueError
            If a time lies outside the trajectory or, unless ``across_gaps``, in one of its gaps, or if the
            trajectory has fewer than two poses.
        """
        if len(self) < 2:
            raise ValueError(f"Trajectory: expected at least two poses to interpolate, got {len(self)}")
        t = np.asarray(t_us)
        if t.ndim > 1:
            raise ValueError(f"t_us: expected one time or times (N,), got {t.shape}")
        if t.size and not (t.min() >= self.t_us[0] and t.max() <= self.t_us[-1]):  # NaN neither
            raise ValueError(f"t_us: expected times within [{self.t_us[0]}, {self.t_us[-1]}] us, got others")
        if not (across_gaps or np.all(self.covers(t))):
            raise ValueError(f"t_us: expected times in no gap, got {np.extract(~self.covers(t), t)[0]} us")
        seconds = (self.t_us - self.t_us[0]) * 1e-6
        rotations = Slerp(seconds, Rotation.from_matrix(self.poses.rotation))
        s = (t - self.t_us[0]) * 1e-6
        position = np.stack([np.interp(s, seconds, c) for c in self.poses.position_m.T], -1)
        return Pose(rotations(s).as_matrix(), position)
