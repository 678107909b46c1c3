"""The laboratory's rig: how camera, arm and port hang together, as files, and the truth that follows from it.

A rig names an arm's two ends: the camera is fixed to ``root``, the port to ``tip``.  If the camera stands
beside the arm, the root is the arm's base; if the camera is on the arm, the root is its effector.
"""

from __future__ import annotations

import json
from collections import deque
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from lmmap.camera_files import LENGTH_M, MAX_BYTES
from lmmap.documents import check_fields, read_json, read_yaml
from lmmap.files import read_text
from lmmap.recordings.limits import MAX_POSITION_M
from lmmap.types import InputError, Port, Pose, Trajectory

from . import ur5e
from .tf import arm_motion

RIG_FILE = "rig.json"  # in a folder of bags
NUMBERS = {"ring_radius_m": LENGTH_M, "delay_s": (float, -3600.0, 3600.0)}  # clocks that are set by hand
MAX_NAME = 1000  # letters of a frame's name
QUATERNION, POSITION = ("qx", "qy", "qz", "qw"), ("x", "y", "z")


@dataclass(frozen=True)
class Rig:
    """``T_cam_port(t) = T_cam_root T_root_tip(t + delay) T_tip_port``, and the ring's radius.

    ``calibration`` says from which recordings it was calibrated, and how well.
    """

    root: str
    tip: str
    T_cam_root: Pose
    T_tip_port: Pose
    ring_radius_m: float
    delay_s: float = 0.0
    calibration: dict | None = None

    @property
    def port(self) -> Port:
        """The LM-MAP, scaled to this ring."""
        return scale_port(Port.lm_map(), self.ring_radius_m)

    def truth(self, path) -> Trajectory:
        """``T_cam_port`` of a bag by its arm, at times of the camera's clock; raises `InputError`."""
        motion = arm_motion(path, self.root, self.tip)
        T = self.T_cam_root @ motion.T_root_tip @ self.T_tip_port
        return Trajectory(motion.t_us - round(self.delay_s * 1e6), T)

    def save(self, path) -> None:
        """Write JSON; raises `OSError`."""
        values = {"root": self.root, "tip": self.tip, "T_cam_root": _matrix(self.T_cam_root),
                  "T_tip_port": _matrix(self.T_tip_port), "ring_radius_m": self.ring_radius_m,
                  "delay_s": self.delay_s, "calibrated": self.calibration or {}}  # fmt: skip
        Path(path).write_text(json.dumps(values, indent=1) + "\n")

    @classmethod
    def load(cls, path) -> Rig:
        """Read what `save` wrote; raises `InputError`."""
        text = read_text(path, MAX_BYTES)
        try:
            v = read_json(text)
            numbers = {name: v[name] for name in NUMBERS}
            numbers = check_fields(numbers, NUMBERS, set(NUMBERS))
            T = [_pose(v[name]) for name in ("T_cam_root", "T_tip_port")]
            return cls(_frame(v["root"]), _frame(v["tip"]), *T, **numbers, calibration=v.get("calibrated"))
        except (ValueError, KeyError, TypeError, OverflowError) as error:
            raise InputError(f"{path}: not a rig ({type(error).__name__}: {error}); "
                             "write it with lmmap calibrate") from None  # fmt: skip


def scale_port(port: Port, ring_radius_m: float) -> Port:
    """The same port with a ring of another size."""
    s = ring_radius_m / port.ring_radius_m
    values = {n: v for n, v in vars(port).items() if n != "symmetry"}
    return replace(port, **{n: tuple(s * x for x in v) if isinstance(v, tuple) else s * v
                            for n, v in values.items()})  # fmt: skip


@dataclass(frozen=True)
class HandEyeFile:
    """The content of a hand-eye file: ``T_frame_cam``, the camera in a frame of the arm.

    That frame is the effector if the camera is ``on_arm``, else the base; ``base`` and ``effector`` are the
    names of the arm's ends.
    """

    T_frame_cam: Pose
    on_arm: bool
    base: str
    effector: str

    @property
    def ends(self) -> tuple[str, str]:
        """(root, tip): the camera's end of the arm and the port's."""
        return (self.effector, self.base) if self.on_arm else (self.base, self.effector)


def read_hand_eye(path) -> HandEyeFile:
    """Read easy_handeye's YAML, or one that holds a 4 x 4 matrix ``T_base_cam``.

    Raises
    ------
    InputError
        If it is neither; the line shows what the file holds.
    """
    path = Path(path)
    text = read_text(path, MAX_BYTES)
    try:
        document = read_yaml(text)
    except ValueError as error:
        raise InputError(f"{path}: not YAML ({error!s:.100}); give the hand-eye calibration") from None
    try:
        return _easy_handeye(document) or _find_matrix(document)
    except (ValueError, TypeError, OverflowError) as error:
        expected = "expected easy_handeye's transformation (x, y, z, qx, qy, qz, qw) or a 4 x 4 matrix"
        raise InputError(f"{path}: no hand-eye calibration ({error}); it holds {_summary(document)}; "
                         f"{expected}") from None  # fmt: skip


def _easy_handeye(document) -> HandEyeFile | None:
    if not isinstance(document, dict) or not isinstance(document.get("transformation"), dict):
        return None
    t = document["transformation"]
    names_from = next(part for part in (document.get("parameters"), document) if isinstance(part, dict))
    if missing := [name for name in (*QUATERNION, *POSITION) if name not in t]:
        raise ValueError(f"its transformation lacks {', '.join(missing)}")
    q, p = (np.array([float(t[name]) for name in names]) for names in (QUATERNION, POSITION))
    if not (np.isfinite(q).all() and np.all(np.abs(p) <= MAX_POSITION_M)):  # NaN neither
        raise ValueError("its transformation is not finite, or beyond any laboratory")
    if abs(np.linalg.norm(q) - 1) > 1e-2:
        raise ValueError("its quaternion is not of unit length")
    names = (
        names_from.get("robot_base_frame") or ur5e.BASE,
        names_from.get("robot_effector_frame") or ur5e.EFFECTOR,
    )
    T = Pose(Rotation.from_quat(q).as_matrix(), p)
    return HandEyeFile(T, bool(names_from.get("eye_on_hand")), *(_frame(n).lstrip("/") for n in names))


def _frame(name) -> str:
    if not isinstance(name, str) or len(name) > MAX_NAME:
        raise ValueError(f"the name of a frame is {name!r:.40}")
    return name


def _find_matrix(document) -> HandEyeFile:
    """The first 4 x 4 matrix anywhere in the document."""
    waiting = deque([document])
    while waiting:
        node = waiting.popleft()
        if isinstance(node, list):
            flat = np.array(node, object).ravel()
            if flat.size == 16 and all(isinstance(v, int | float) for v in flat):
                T = _pose(np.array(flat, float).reshape(4, 4))
                return HandEyeFile(T, False, ur5e.BASE, ur5e.EFFECTOR)
        elif isinstance(node, dict):
            waiting.extend(node.values())
    raise ValueError("neither layout")


def _pose(matrix) -> Pose:
    M = np.array(matrix, float)
    if M.shape != (4, 4) or not np.all(np.abs(M) <= MAX_POSITION_M):  # NaN neither
        raise ValueError(f"its matrix is not one of 4 x 4 finite numbers up to {MAX_POSITION_M:g}")
    R = M[:3, :3]
    rigid = np.linalg.det(R) > 0 and np.allclose(R @ R.T, np.eye(3), rtol=0, atol=1e-3)
    if not (rigid and np.array_equal(M[3], [0, 0, 0, 1])):
        raise ValueError("its 4 x 4 matrix is no rigid transform")
    return Pose(R, M[:3, 3])


def _matrix(T: Pose) -> list:
    return np.vstack([np.column_stack([T.rotation, T.position_m]), [0, 0, 0, 1]]).tolist()


def _summary(document) -> str:
    if isinstance(document, dict):
        return f"keys {', '.join(map(str, document)):.200}"
    return f"{type(document).__name__} {str(document)[:60]!r}"
