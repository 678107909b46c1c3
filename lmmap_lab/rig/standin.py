"""Stand-ins for the authors' bags: recordings of the bench with the same layout, topics and names.

A simulated UR5e carries the port as the bench moves it.  `RIG` says how camera, arm and port hang together.
Of it only the camera is written, into a hand-eye file; the rest is for a calibration to find.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from lmmap.disk import is_there
from lmmap.files import atomic, read_text, writes
from lmmap.geometry.projection import bearings
from lmmap.geometry.rotations import rotation_z
from lmmap.types import EVENT, Camera, Estimate, InputError, Pose, Recording, Status, Trajectory
from lmmap_lab.unfinished import is_own, remove_folder
from lmmap_readers.rig import Rig

from ..bench import rosbag_writer, sequences
from ..bench.laboratory import sequence, sequence_motion
from . import authors_bags, tf, ur5e
from .ur5e import ArmMotion

ARM_HZ = 125  # rate of the arm's driver
SAMPLES = 3  # rays in a pixel of the checkerboard, along each axis
START_US = 1_000_000_000  # a bag's time must not be zero
# the arm stands below the port, where it reaches a minute of the test sequences: its z is the camera's -y
_FACING = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
_MOUNT = Rotation.from_euler("xyz", [3.0, -2.0, 17.0], degrees=True).as_matrix()
RIG = Rig(ur5e.BASE, ur5e.EFFECTOR, Pose(_FACING @ rotation_z(0.0), [0.337, 0.36, 0.657]),
          Pose(_MOUNT, [0.004, -0.006, 0.114]), 0.08)  # fmt: skip
BOARD = "dataset_0307/dvs_calibration.bag"
STAND_INS = (  # the authors' name, and the bench's sequence in its place
    ("dataset_0307/T1_RA_0_ES_0_texture1.bag", "augmented-0"),
    ("dataset_0307/T2_RA_50_ES_1_texture2.bag", "augmented-2"),
    ("dataset_0307/T1_RA_0_ES_1_noport.bag", "empty-1"),
    ("dataset_0307_notexture/normal__train.bag", "realistic-1"),
    ("dataset_0307_notexture/dark__test.bag", "test-low"),
    ("dataset_0307_notexture/normal__test.bag", "test-medium"),
    ("dataset_0307_notexture/light__test.bag", "test-high"),
    ("hard_cases_benchmark/dark__hard.bag", "hard-slow"),
    ("hard_cases_benchmark/light__hard.bag", "hard-reflect"),
)


def write_bag(recording: Recording, path, rig: Rig = RIG) -> None:
    """Write a recording of the bench as a bag like the authors'; the arm's motion alone holds its truth.

    The arm stands still if the recording has no truth.  Raises `InputError` if the arm cannot follow.
    """
    span_s = recording.frames_t_us[-1] * 1e-6 if len(recording.frames_t_us) else 1.0
    t_us = np.arange(0, span_s * 1e6 + 1e5, 1e6 / ARM_HZ).astype(np.int64)
    if recording.truth is not None:
        truth = recording.truth
        t_us = np.unique(np.r_[t_us[(t_us >= truth.t_us[0]) & (t_us <= truth.t_us[-1])], truth.t_us])
        try:
            joints = ur5e.follow(arm_poses(truth.at(t_us), rig))
        except ValueError as error:
            raise InputError(f"{path}: the stand-in's arm cannot follow {recording.name} ({error}); "
                             "take fewer seconds or another sequence") from None  # fmt: skip
    else:
        joints = np.tile([0.0, -1.6, 1.6, -1.6, -1.6, 0.0], (len(t_us), 1))
    with atomic(path) as temporary:
        others = tf.arm_messages(t_us + START_US, joints)
        rosbag_writer.write(shift_time(recording, START_US), temporary, others, calibrated=False)


def arm_poses(T_cam_port: Pose, rig: Rig = RIG) -> Pose:
    """``T_root_tip`` at which the arm holds the port at ``T_cam_port``."""
    return rig.T_cam_root.inverse @ T_cam_port @ rig.T_tip_port.inverse


def shift_time(recording: Recording, by_us: int) -> Recording:
    """The same recording, ``by_us`` later."""
    events = recording.events.copy()
    events["t_us"] += by_us
    truth = recording.truth and Trajectory(recording.truth.t_us + by_us, recording.truth.poses)
    return replace(recording, events=events, frames_t_us=recording.frames_t_us + by_us, truth=truth)


def write_hand_eye(path, rig: Rig = RIG) -> None:
    """Write the camera's pose in the arm's base as easy_handeye does.

    Raises `InputError` if it cannot be written, or if another file has its name.
    """
    T = rig.T_cam_root.inverse
    about = {"eye_on_hand": False, "robot_base_frame": rig.root, "robot_effector_frame": rig.tip,
             "tracking_base_frame": "dvs", "tracking_marker_frame": "board"}  # fmt: skip
    names = ("x", "y", "z", "qx", "qy", "qz", "qw")
    values = [float(v) for v in (*T.position_m, *T.quaternion_xyzw)]
    document = {"parameters": about, "transformation": dict(zip(names, values, strict=True))}
    text = yaml.safe_dump(document)
    if is_there(path):
        if read_text(path, 2**16) != text:
            raise InputError(f"{path}: is not ours to replace; move it away, or give another folder")
        return
    with atomic(path) as part:
        part.write_text(text)


def write_set(folder, seconds: float, report=print) -> None:
    """Write a small set with the layout of the authors' data; bags that are there are kept.

    Raises `InputError` if the folder cannot be written.
    """
    folder = Path(folder)
    with writes(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for name in (BOARD, *(name for name, _ in STAND_INS)):
            (folder / name).parent.mkdir(exist_ok=True)
    write_hand_eye(folder / authors_bags.HAND_EYE)
    board = folder / BOARD
    if not is_there(board):
        write_bag(simulate_checkerboard(Camera.davis346()), board)
    for name, stands_in in STAND_INS:
        parts = (folder / name).with_suffix(".parts")
        if not is_there(folder / name):
            write_bag(sequences.simulate(stands_in, seconds, parts=parts), folder / name)
        if is_own(parts):  # a run may have been killed once its bag was whole
            remove_folder(parts)
        report(f"{folder / name}: {stands_in}, {(folder / name).stat().st_size / 1e6:.0f} MB")


def simulate_detections(name: str, seconds: float, rng: np.random.Generator, rig: Rig = RIG,
                        rate_hz: float = 10.0, noise_m: float = 0.002, noise_rad: float = np.deg2rad(1.0),
                        outliers: float = 0.05,
                        scale: float = 1.0) -> tuple[list[Estimate], ArmMotion]:  # fmt: skip
    """Estimates of a sequence with typical errors, drawn without images, and the arm's motion.

    Yaw is known modulo the port's symmetry.  A share of ``outliers`` is anywhere.  Positions are divided by
    ``scale``, as if the ring were assumed smaller by that factor.

    Returns
    -------
    estimates, all with a pose; the arm's motion
    """
    seq, t_us = sequence(name), np.arange(0, seconds * 1e6, 1e6 / ARM_HZ).astype(np.int64)
    arm = ArmMotion(t_us, arm_poses(sequence_motion(seq, t_us * 1e-6), rig))
    detected_us = np.arange(5e4, t_us[-1], 1e6 / rate_hz).astype(np.int64)
    T, count = sequence_motion(seq, detected_us * 1e-6), len(detected_us)
    turn = Rotation.from_rotvec(rng.normal(0, noise_rad, (count, 3))).as_matrix()
    rotation = (
        turn @ T.rotation @ rotation_z(rig.port.yaw_period_rad * rng.integers(0, rig.port.symmetry, count))
    )
    position_m = T.position_m / scale + rng.normal(0, noise_m, (count, 3))
    wrong = rng.random(count) < outliers
    rotation[wrong] = Rotation.random(wrong.sum(), rng=rng).as_matrix()
    position_m[wrong] += rng.normal(0, 0.1, (wrong.sum(), 3))
    estimates = [Estimate(int(t), Status.OK, Pose(R, p))
             for t, R, p in zip(detected_us, rotation, position_m, strict=True)]  # fmt: skip
    return estimates, arm


def simulate_checkerboard(camera: Camera, corners: tuple[int, int] = (8, 5), square_m: float = 0.03,
                    views: int = 16, seed: int = 0) -> Recording:  # fmt: skip
    """A recording of a checkerboard before the camera, without events."""
    rng = np.random.default_rng(seed)
    centre_m = np.array([(corners[0] - 1) / 2, (corners[1] - 1) / 2, 0]) * square_m
    offsets = (np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5
    u, v = (np.add.outer(np.arange(n), offsets).ravel() for n in camera.size_px)
    rays = bearings(np.stack(np.meshgrid(u, v), -1), camera)
    frames = []
    for _ in range(views):
        turn = Rotation.from_rotvec(rng.uniform([-0.6, -0.6, -0.3], [0.6, 0.6, 0.3])).as_matrix()
        depth_m = rng.uniform(0.3, 0.5)
        middle_m = np.array([*(rng.uniform(-0.25, 0.25, 2) * depth_m), depth_m])
        frames.append(_board(Pose(turn, middle_m - turn @ centre_m), rays, corners, square_m))
    t_us = (np.arange(views) * 500_000 + 500_000).astype(np.int64)
    return Recording("board", camera, np.empty(0, EVENT), np.array(frames), t_us)


def _board(T_cam_board: Pose, rays, corners, square_m: float) -> np.ndarray:
    """A frame (H, W, 3) u8 of a board with a white rim; ``rays`` are its lines of sight (H S, W S, 3)."""
    eye_m, direction = T_cam_board.inverse.position_m, rays @ T_cam_board.rotation
    xy = (eye_m[:2] - eye_m[2] / direction[..., 2:] * direction[..., :2]) / square_m
    cell = np.floor(xy).clip(-99, 99).astype(int)
    inside = np.all((cell >= -1) & (cell < corners), -1)
    rim = np.all((cell >= -2) & (cell <= corners), -1)
    light = np.where(inside & (cell.sum(-1) % 2 == 0), 20.0, np.where(rim, 220.0, 60.0))
    height, width = (n // SAMPLES for n in light.shape)
    light = light.reshape(height, SAMPLES, width, SAMPLES).mean((1, 3))
    return np.repeat(light[..., None], 3, -1).round().astype(np.uint8)
