"""Calibration of a rig from detections: the port on the arm, the ring's size, and if need be the camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lmmap.geometry.rotations import rotation_angle_rad
from lmmap.types import Estimate, InputError, Port, Pose
from lmmap_readers.rig import Rig

from . import hand_eye
from .ur5e import ArmMotion, ArmSamples

DIFFERS_M, DIFFERS_RAD = (
    0.02,
    np.deg2rad(3.0),
)  # a hand-eye file is doubted if it is this far from our own estimate


@dataclass(frozen=True)
class Detections:
    """Detections of one bag: poses ``T_cam_port`` (N,), covariances (N, 6, 6), and the arm at their times."""

    T_cam_port: Pose
    covariance: np.ndarray
    arm: ArmSamples


def collect_detections(estimates: list[Estimate], motion: ArmMotion) -> Detections:
    """The estimates with a pose at times at which the arm reports."""
    span = motion.t_us[[0, -1]]
    detected = [e for e in estimates if e.T_cam_port is not None and span[0] <= e.t_us <= span[1]]
    default = np.diag(np.repeat([hand_eye.SIGMA_M**2, hand_eye.SIGMA_RAD**2], 3))
    covariance = [default if e.covariance is None else e.covariance for e in detected]
    poses = Pose.stack([e.T_cam_port for e in detected])
    arm = motion.sample([e.t_us for e in detected])
    return Detections(poses, np.array(covariance).reshape(-1, 6, 6), arm)


def calibrate_rig(bags: list[Detections], port: Port, ends: tuple[str, str],
                  T_cam_root: Pose | None = None) -> Rig:  # fmt: skip
    """The rig that one or several bags of the same laboratory agree on.

    Parameters
    ----------
    bags : detections of each bag, estimated with ``port``
    ends : names of the arm's (root, tip)
    T_cam_root : from a hand-eye file, if there is one; our own estimate is then compared with it

    Returns
    -------
    Rig
        ``calibration`` holds the number of detections, medians on held-out stretches of time (mm, deg),
        standard deviations, and how far the file's camera is from ours.

    Raises
    ------
    InputError
        If the detections are too few, or the arm moves too little.
    """
    poses, T_root_tip = Pose.stack([b.T_cam_port for b in bags]), Pose.stack([b.arm.T_root_tip for b in bags])
    arm = ArmSamples(T_root_tip, np.concatenate([b.arm.velocity for b in bags]))
    data = (poses, arm, port.yaw_period_rad, np.concatenate([b.covariance for b in bags]))
    try:
        result = hand_eye.solve(*data, T_cam_root=T_cam_root)
    except ValueError as error:
        raise InputError(f"calibrate: {error}; give longer bags, or more of them") from None
    facts = _quality(result, len(poses))
    if T_cam_root:
        facts |= _difference_from_file(data, T_cam_root)
    radius_m = port.ring_radius_m * result.scale
    facts["camera"] = "from the hand-eye file" if T_cam_root else "estimated"
    return Rig(*ends, result.T_cam_root, result.T_tip_port, radius_m, result.delay_s, facts)


def _quality(result: hand_eye.HandEye, count: int) -> dict:
    """How well a calibration is known, in millimetres and degrees."""
    camera_m, camera_rad, port_m, port_rad = (np.linalg.norm(s) for s in result.sigma[:12].reshape(4, 3))
    return {
        "detections": count,
        "kept_percent": 100 * float(result.kept.mean()),
        "held_out_position_median_mm": 1e3 * float(np.median(result.errors_m)),
        "held_out_rotation_median_deg": float(np.rad2deg(np.median(result.errors_rad))),
        "port_sigma_mm": 1e3 * float(port_m),
        "port_sigma_deg": float(np.rad2deg(port_rad)),
        "camera_sigma_mm": 1e3 * float(camera_m),
        "camera_sigma_deg": float(np.rad2deg(camera_rad)),
        "radius_sigma_percent": 100 * float(result.sigma[12]),
        "delay_sigma_ms": 1e3 * float(result.sigma[13]),
    }


def _difference_from_file(data, known: Pose) -> dict:
    """How far a file's camera is from the one that the detections alone give."""
    try:
        free = hand_eye.solve(*data)
    except ValueError:  # the detections decide the port, but not the camera as well
        return {}
    angle = rotation_angle_rad(free.T_cam_root.rotation @ known.rotation.T)
    distance_m = np.linalg.norm(free.T_cam_root.inverse.position_m - known.inverse.position_m)
    return {
        "file_differs_mm": 1e3 * float(distance_m),
        "file_differs_deg": float(np.rad2deg(angle)),
        "file_in_doubt": bool(distance_m > DIFFERS_M or angle > DIFFERS_RAD),
    }
