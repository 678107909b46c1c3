"""An arm's motion from a bag: a chain of links in /tf, with /joint_states where /tf lacks a link.

Each link ``T_parent_child(t)`` of the chain is interpolated at the times of the link that is reported most
often.  Times are the stamps of the messages, as the camera's are.
"""

from __future__ import annotations

import struct
from array import array
from collections import defaultdict
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from lmmap.recordings.limits import MAX_POSITION_M
from lmmap.recordings.rosbag import open_bag
from lmmap.types import InputError, Pose

from ..bench.rosbag_writer import STORE, header, text
from . import ur5e
from .chain import complete_chain
from .ur5e import LinkMotion

TF = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
STATES = "sensor_msgs/msg/JointState"
GLANCE_S = 5.0  # of a bag that are enough to see the names of its frames
ENDS = ((ur5e.BASE, ur5e.EFFECTOR), ("base", "tool0_controller"))  # names of the two ends in drivers for a UR


def arm_motion(path, root: str, tip: str, seconds: float = np.inf) -> ur5e.ArmMotion:
    """The motion of a bag's arm, or of its first ``seconds``, between the frames ``root`` and ``tip``.

    Raises
    ------
    InputError
        Names the topic or link that is missing, or a link on a loop.
    """
    path = Path(path)
    links, chain = complete_chain(path, *read_transforms(path, seconds), root, tip)
    steps = [(links[parent, child], backward) for parent, child, backward in chain]
    moving = [link for link, _ in steps if len(link) > 1]
    if not moving:
        raise InputError(
            f"{path}: {root} to {tip} never moves in /tf; give a bag whose arm reports its motion"
        )
    first_us, last_us = max(m.t_us[0] for m in moving), min(m.t_us[-1] for m in moving)
    t_us = max((m.t_us for m in moving), key=len)
    t_us = t_us[(t_us >= first_us) & (t_us <= last_us)]
    if len(t_us) < 2:
        raise InputError(
            f"{path}: the links of {root} to {tip} are never reported at the same time; record again"
        )
    T = Pose.identity()
    for link, backward in steps:
        T_parent_child = link.at(t_us)
        T = T @ (T_parent_child.inverse if backward else T_parent_child)
    return ur5e.ArmMotion(t_us, T)


def arm_ends(path) -> tuple[str, str]:
    """(base, effector) as this bag's /tf names them: the first of `ENDS` that it has."""
    frames = {frame for pair in read_transforms(path, GLANCE_S)[0] for frame in pair}
    return next((ends for ends in ENDS if frames & {ends[0]} or frames & {ends[1]}), ENDS[0])


def read_transforms(path, seconds: float = np.inf) -> tuple[dict, dict]:
    """Everything that a bag says of its arm.

    Returns
    -------
    links : `LinkMotion` of /tf and /tf_static by (parent, child)
    joints : times (N,) us and angles (N, 1) rad of /joint_states by name

    Raises
    ------
    InputError
        For a bag that cannot be read or has neither.
    """
    path = Path(path)
    rows, angles = (defaultdict(partial(array, "d")) for _ in range(2))  # packed, as a bag may hold millions
    with open_bag(path) as bag:
        wanted = [c for c in bag.connections if c.msgtype in (*TF, STATES)]
        if not wanted:
            topics = ", ".join(sorted(bag.topics)) or "none"
            raise InputError(f"{path}: no /tf and no /joint_states among its topics ({topics}); "
                             "give a bag that has the arm's motion")  # fmt: skip
        stop = bag.start_time + int(seconds * 1e9) if np.isfinite(seconds) else None
        for connection, _, raw in bag.messages(wanted, stop=stop):
            if connection.msgtype == STATES:
                m = STORE.deserialize_ros1(raw, STATES)
                t_us = _microseconds(m.header.stamp.sec, m.header.stamp.nanosec)
                for name, angle in zip(m.name, m.position, strict=False):
                    angles[name].extend((t_us, angle))
            else:
                for parent, child, t_us, values in _transforms(raw):
                    rows[parent, child].extend((t_us, *values))
        links = {pair: _link(" to ".join(pair), table) for pair, table in rows.items()}
        return links, {
            name: _sort_rows(name, np.array(table).reshape(-1, 2)) for name, table in angles.items()
        }


def _transforms(raw: bytes) -> Iterator[tuple]:
    """``(parent, child, t_us, (x, y, z, qx, qy, qz, qw))`` of a TFMessage's bytes."""
    (count,), at = struct.unpack_from("<I", raw), 4
    for _ in range(count):
        seconds, nanoseconds = struct.unpack_from("<II", raw, at + 4)
        names, at = [], at + 12
        for _ in range(2):
            (length,) = struct.unpack_from("<I", raw, at)
            names.append(raw[at + 4 : at + 4 + length].decode().lstrip("/"))
            at += 4 + length
        yield *names, _microseconds(seconds, nanoseconds), struct.unpack_from("<7d", raw, at)
        at += 56


def _microseconds(seconds: int, nanoseconds: int) -> int:
    return seconds * 10**6 + (nanoseconds + 500) // 1000


def _sort_rows(name: str, table: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times and values in the order of time, each time once; ValueError if a number is not finite."""
    if not np.isfinite(table).all():
        raise ValueError(f"{name} is not finite at some time")
    t_us, index = np.unique(table[:, 0].astype(np.int64), return_index=True)
    return t_us, table[index, 1:]


def _link(name: str, table: array) -> LinkMotion:
    t_us, values = _sort_rows(name, np.array(table).reshape(-1, 8))
    if np.any(np.abs(values[:, :3]) > MAX_POSITION_M):
        raise ValueError(f"{name} has a position beyond any laboratory's")
    if np.any(np.abs(np.linalg.norm(values[:, 3:], axis=1) - 1) > 1e-2):
        raise ValueError(f"{name} has a quaternion that is not of unit length")
    return LinkMotion(t_us, Pose(Rotation.from_quat(values[:, 3:]).as_matrix(), values[:, :3]))


def arm_messages(t_us, joints_rad) -> list[tuple]:
    """Topics /tf and /joint_states of a UR5e at times (N,) with joint angles (N, 6), for a bag."""
    links = [(ur5e.LINKS[k], ur5e.LINKS[k + 1], ur5e.joint_link(k, joints_rad[:, k])) for k in range(6)]
    fixed = [(p, c, T[None].rotation, T[None].position_m) for (p, c), T in ur5e.FIXED.items()]
    moving = [(p, c, T.rotation, T.position_m) for p, c, T in links]
    frames = [(p, c, Rotation.from_matrix(R).as_quat(), x) for p, c, R, x in moving + fixed]

    def tf():
        for k, t in enumerate(t_us):
            transforms = [header(int(t), parent) + text(child)
                          + np.r_[x[k % len(x)], q[k % len(q)]].astype("<f8").tobytes()
                          for parent, child, q, x in frames]  # fmt: skip
            yield int(t), struct.pack("<I", len(transforms)) + b"".join(transforms)

    def states():
        names = struct.pack("<I", 6) + b"".join(text(name) for name in ur5e.JOINTS)
        for t, angles in zip(t_us, joints_rad, strict=True):
            body = names + struct.pack("<I6d", 6, *angles) + struct.pack("<II", 0, 0)
            yield int(t), header(int(t)) + body

    return [("/tf", TF[0], tf()), ("/joint_states", STATES, states())]
