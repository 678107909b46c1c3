"""The arm of the paper's laboratory, a UR5e: its nominal kinematics, forward and inverse, and its motion.

Frames and joints have the names of the arm's ROS driver.  Joint angles are (..., 6) rad in the order of
`JOINTS`.  A real arm differs from the nominal one by about a millimetre; its own /tf includes that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from lmmap.types import Pose, Trajectory

JOINTS = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint",
          "wrist_1_joint", "wrist_2_joint", "wrist_3_joint")  # fmt: skip
LINKS = ("base_link_inertia", "shoulder_link", "upper_arm_link", "forearm_link",
         "wrist_1_link", "wrist_2_link", "wrist_3_link")  # fmt: skip
BASE, EFFECTOR = "base_link", "tool0"
STEP_US = 20_000  # velocity is measured over this time before and after
# the manufacturer's Denavit-Hartenberg lengths
D1, A2, A3, D4, D5, D6 = 0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996
# each joint in its parent's frame: position (m), then a turn about x (rad)
SEATS_M = np.array([[0, 0, D1], [0, 0, 0], [A2, 0, 0], [A3, 0, D4], [0, -D5, 0], [0, D6, 0]])
SEATS_RAD = np.pi / 2 * np.array([0, 1, 0, 0, 1, -1])


def _fixed_transform(*rpy_rad) -> Pose:
    return Pose(Rotation.from_euler("xyz", rpy_rad).as_matrix(), np.zeros(3))


FIXED = {  # T_parent_child of links that never move
    (BASE, LINKS[0]): _fixed_transform(0, 0, np.pi),
    (BASE, "base"): _fixed_transform(0, 0, np.pi),
    (LINKS[-1], "flange"): _fixed_transform(0, -np.pi / 2, -np.pi / 2),
    ("flange", EFFECTOR): _fixed_transform(np.pi / 2, 0, np.pi / 2),
}


def joint_link(index: int, angle_rad) -> Pose:
    """``T_parent_child`` of joint ``index`` at angles (...): from ``LINKS[index]`` to the next link."""
    angle_rad = np.asarray(angle_rad, float)
    seat = Rotation.from_rotvec([SEATS_RAD[index], 0, 0]).as_matrix()
    turn = Rotation.from_rotvec(angle_rad[..., None] * np.array([0, 0, 1.0])).as_matrix()
    return Pose(seat @ turn, np.broadcast_to(SEATS_M[index], (*angle_rad.shape, 3)))


def forward(joints_rad) -> Pose:
    """``T_base_tool`` (`BASE` to `EFFECTOR`) at joint angles (..., 6)."""
    joints_rad = np.asarray(joints_rad, float)
    T = FIXED[BASE, LINKS[0]]
    for index in range(len(JOINTS)):
        T = T @ joint_link(index, joints_rad[..., index])
    return T @ FIXED[LINKS[-1], "flange"] @ FIXED["flange", EFFECTOR]


def inverse(T_base_tool: Pose) -> np.ndarray:
    """All joint angles that reach poses (N,): (N, 8, 6), NaN where a branch does not reach one.

    The closed form for arms with a spherical shoulder and three parallel axes: the second wrist's position
    gives joint 1, the tool's axis gives joint 5, and the rest is a planar arm of two links (Hawkins 2013).
    """
    T = FIXED[BASE, LINKS[0]].inverse @ T_base_tool
    branches = [_branch(T, *signs) for signs in np.ndindex(2, 2, 2)]
    return np.stack(branches, -2)


def _branch(T: Pose, shoulder: int, wrist: int, elbow: int) -> np.ndarray:
    R, p = T.rotation, T.position_m
    with np.errstate(invalid="ignore", divide="ignore"):
        wrist_m = p - D6 * R[..., :, 2]
        reach = np.arccos(D4 / np.hypot(wrist_m[..., 0], wrist_m[..., 1]))
        q1 = np.arctan2(wrist_m[..., 1], wrist_m[..., 0]) + (reach if shoulder else -reach) + np.pi / 2
        s1, c1 = np.sin(q1), np.cos(q1)
        side_m = p[..., 0] * s1 - p[..., 1] * c1
        q5 = np.arccos((side_m - D4) / D6) * (1 if wrist else -1)
        s5 = np.sin(q5)
        x6, y6 = (R[..., 0, k] * s1 - R[..., 1, k] * c1 for k in (0, 1))
        q6 = np.arctan2(-y6 / s5, x6 / s5)
        plane = joint_link(0, q1)
        tail = joint_link(4, q5) @ joint_link(5, q6)
        middle = plane.inverse @ T @ tail.inverse  # joints 2 to 4: a turn about the axis that they share
        x_m, z_m = middle.position_m[..., 0], middle.position_m[..., 2]
        cosine = (x_m**2 + z_m**2 - A2**2 - A3**2) / (2 * A2 * A3)
        q3 = np.arccos(cosine) * (1 if elbow else -1)
        q2 = np.arctan2(z_m, x_m) - np.arctan2(A3 * np.sin(q3), A2 + A3 * np.cos(q3))
        total = np.arctan2(middle.rotation[..., 2, 0], middle.rotation[..., 0, 0])
    return np.stack([q1, q2, q3, total - q2 - q3, q5, q6], -1)


def follow(T_base_tool: Pose) -> np.ndarray:
    """Continuous joint angles (N, 6) along a path (N,) of poses, on the branch whose joints move least.

    Raises ValueError if no branch reaches the whole path.
    """
    joints = np.unwrap(inverse(T_base_tool), axis=0)
    moved = np.abs(np.diff(joints, axis=0)).max((0, 2), initial=0)
    moved[np.isnan(joints).any((0, 2))] = np.inf
    best = np.argmin(moved)
    if not np.isfinite(moved[best]):
        raise ValueError("T_base_tool: expected a path within the arm's reach")
    return joints[:, best]


@dataclass(frozen=True)
class LinkMotion:
    """A link's ``T_parent_child`` at strictly increasing times ``t_us`` (N,); a fixed link has one pose."""

    t_us: np.ndarray
    T_parent_child: Pose

    def __len__(self) -> int:
        return len(self.t_us)

    def at(self, t_us) -> Pose:
        """``T_parent_child`` at times inside the motion; a fixed link's pose at any time."""
        if len(self) == 1:
            return self.T_parent_child[0]
        return Trajectory(self.t_us, self.T_parent_child).at(t_us, across_gaps=True)


@dataclass(frozen=True)
class ArmSamples:
    """An arm at N times: ``T_root_tip`` (N,), and its velocity (N, 6) in the root's axes, m/s and rad/s."""

    T_root_tip: Pose
    velocity: np.ndarray

    def __len__(self) -> int:
        return len(self.T_root_tip)


@dataclass(frozen=True)
class ArmMotion:
    """Poses ``T_root_tip`` of one end of an arm in the other, at strictly increasing times ``t_us`` (N,)."""

    t_us: np.ndarray
    T_root_tip: Pose

    def __len__(self) -> int:
        return len(self.t_us)

    def at(self, t_us) -> Pose:
        """``T_root_tip`` at times inside the motion, interpolated as `Trajectory.at` does."""
        return Trajectory(self.t_us, self.T_root_tip).at(t_us, across_gaps=True)

    def sample(self, t_us) -> ArmSamples:
        """Poses and velocities at times (N,) inside the motion."""
        t_us = np.asarray(t_us, np.int64)
        a, b = (np.clip(t_us + s, self.t_us[0], self.t_us[-1]) for s in (-STEP_US, STEP_US))
        before, after, seconds = self.at(a), self.at(b), np.maximum(b - a, 1)[:, None] * 1e-6
        turn = Rotation.from_matrix(after.rotation @ np.swapaxes(before.rotation, -1, -2)).as_rotvec()
        velocity = np.hstack([(after.position_m - before.position_m) / seconds, turn / seconds])
        return ArmSamples(self.at(t_us), velocity)
