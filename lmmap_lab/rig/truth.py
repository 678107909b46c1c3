"""The truth of a bag by its arm: where the port was in the camera's frame while the arm moved it."""

from __future__ import annotations

from pathlib import Path

from lmmap.types import Trajectory
from lmmap_readers.rig import Rig

from .tf import arm_motion


def true_trajectory(path: Path, rig: Rig) -> Trajectory:
    """``T_cam_port`` of a bag, at times of the camera's clock; raises `InputError`."""
    motion = arm_motion(path, rig.root, rig.tip)
    T = rig.T_cam_root @ motion.T_root_tip @ rig.T_tip_port
    return Trajectory(motion.t_us - round(rig.delay_s * 1e6), T)
