"""A rig's file: how a laboratory's camera, arm and port are connected; it lies beside the bags it applies to.

A rig names an arm's two ends: the camera is fixed to ``root``, the port to ``tip``.  If the camera stands
beside the arm, the root is the arm's base; if the camera is on the arm, the root is its effector.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lmmap.camera_files import LENGTH_M, MAX_BYTES
from lmmap.documents import check_fields, read_json
from lmmap.files import beside, read_text, write_text
from lmmap.recordings.limits import MAX_POSITION_M
from lmmap.types import InputError, Port, Pose

RIG_FILE = "rig.json"  # in a folder of bags
NUMBERS = {"ring_radius_m": LENGTH_M, "delay_s": (float, -3600.0, 3600.0)}  # clocks that are set by hand
MAX_NAME = 1000  # letters of a frame's name


@dataclass(frozen=True)
class Rig:
    """``T_cam_port(t) = T_cam_root T_root_tip(t + delay) T_tip_port``, and the ring's radius.

    ``calibration`` says from which recordings the rig was calibrated, and how accurately.
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

    def save(self, path) -> None:
        """Write JSON; raises `InputError`, also for a rig that could not be read again."""
        values = {"root": self.root, "tip": self.tip, "T_cam_root": _matrix(self.T_cam_root),
                  "T_tip_port": _matrix(self.T_tip_port), "ring_radius_m": self.ring_radius_m,
                  "delay_s": self.delay_s, "calibrated": self.calibration or {}}  # fmt: skip
        text = json.dumps(values, indent=1) + "\n"
        self._of(text, path)
        write_text(path, text)

    @classmethod
    def load(cls, path) -> Rig:
        """Read what `save` wrote; raises `InputError`."""
        return cls._of(read_text(path, MAX_BYTES), path)

    @classmethod
    def _of(cls, text: str, path) -> Rig:
        try:
            v = read_json(text)
            numbers = {name: v[name] for name in NUMBERS}
            numbers = check_fields(numbers, NUMBERS, set(NUMBERS))
            frames = [frame_name(v[name]) for name in ("root", "tip")]
            T = [rigid_transform(v[name]) for name in ("T_cam_root", "T_tip_port")]
            return cls(*frames, *T, **numbers, calibration=v.get("calibrated"))
        except (ValueError, KeyError, TypeError, OverflowError) as error:
            raise InputError(f"{path}: not a rig ({type(error).__name__}: {error}); "
                             "write it with lmmap calibrate") from None  # fmt: skip


def scale_port(port: Port, ring_radius_m: float) -> Port:
    """Scale a port's lengths so that its ring has another radius."""
    s = ring_radius_m / port.ring_radius_m
    values = {n: v for n, v in vars(port).items() if n.endswith("_m")}
    return replace(port, **{n: tuple(s * x for x in v) if isinstance(v, tuple) else s * v
                            for n, v in values.items()})  # fmt: skip


def find_rig(recording: Path | None) -> Rig | None:
    """The rig in a bag's folder, or in the one above; None for other recordings; raises `InputError`."""
    path = beside(recording, RIG_FILE) if recording and recording.suffix == ".bag" else None
    return Rig.load(path) if path else None


def frame_name(name) -> str:
    """The name of a frame as read from a file; raises ValueError if it is not a name."""
    if not isinstance(name, str) or len(name) > MAX_NAME:
        raise ValueError(f"the name of a frame is {name!r:.40}")
    return name


def rigid_transform(matrix) -> Pose:
    """The pose of a 4 x 4 matrix as read from a file; raises ValueError if it is not a rigid transform."""
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
