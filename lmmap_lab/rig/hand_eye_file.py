"""Hand-eye files: where the camera is on the arm, as other programs have written it."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from lmmap.camera_files import MAX_BYTES
from lmmap.files import read_text
from lmmap.recordings.limits import MAX_POSITION_M
from lmmap.types import InputError, Pose
from lmmap_readers.documents import read_yaml
from lmmap_readers.rig import frame_name, rigid_transform

from . import ur5e

QUATERNION, POSITION = ("qx", "qy", "qz", "qw"), ("x", "y", "z")


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
    return HandEyeFile(T, bool(names_from.get("eye_on_hand")), *(frame_name(n).lstrip("/") for n in names))


def _find_matrix(document) -> HandEyeFile:
    """The first 4 x 4 matrix anywhere in the document."""
    waiting = deque([document])
    while waiting:
        node = waiting.popleft()
        if isinstance(node, list):
            flat = np.array(node, object).ravel()
            if flat.size == 16 and all(isinstance(v, int | float) for v in flat):
                T = rigid_transform(np.array(flat, float).reshape(4, 4))
                return HandEyeFile(T, False, ur5e.BASE, ur5e.EFFECTOR)
        elif isinstance(node, dict):
            waiting.extend(node.values())
    raise ValueError("neither layout")


def _summary(document) -> str:
    if isinstance(document, dict):
        return f"keys {', '.join(map(str, document)):.200}"
    return f"{type(document).__name__} {str(document)[:60]!r}"
