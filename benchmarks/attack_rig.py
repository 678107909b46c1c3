"""The folder that the attack suite damages: a recording in every format, a sound laboratory, whose arm moves
the port before the camera, a board, a training set, and what commands make of them."""

from __future__ import annotations

from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path

import attack_calls
import attack_sound
import drawn
import numpy as np
import toy_training
from scipy.spatial.transform import Rotation

from lmmap.cli.main import main
from lmmap.types import EVENT, Camera, Pose, Recording, Trajectory
from lmmap_lab.bench import rosbag_writer
from lmmap_lab.rig import standin, tf, ur5e
from lmmap_lab.rig.standin import simulate_checkerboard  # as it is, not as `attack_calls.stub` leaves it

CAMERA, BOARD_CAMERA = Camera(128, 96, 324.0, 324.0, 63.5, 47.5), Camera(346, 260, 330.0, 328.0, 170.0, 131.0)
IMAGES, SHORT, STEP_US = 26, 4, 100_000  # a calibration needs 20 detections
MADE = """
estimate r.h5 --modality rgb -o poses.csv
estimate r.h5 --modality rgb -o poses.tum
estimate r.h5 --modality rgb -o poses.bag
draw r.h5 poses.csv --modality rgb -o drawn.mp4
adapt r.h5 --modality rgb --steps 2 -o adapted
simulate --sequence realistic-7 --seconds 0.2 --camera small.json -o simulated.h5
"""


def motion(count: int) -> Pose:
    """``T_cam_port`` (count,) of a port that turns about two axes, a ring of some 50 px."""
    phase = np.linspace(0, 2 * np.pi, count)
    tilt = np.stack([0.35 * np.cos(phase), 0.35 * np.sin(2 * phase), 0 * phase], -1)
    facing = Rotation.from_rotvec([np.pi, 0, 0])
    turn = Rotation.from_rotvec(tilt) * facing * Rotation.from_rotvec(np.outer(phase / 6, [0, 0, 1]))
    position = [0.02 * np.sin(3 * phase), 0.01 * np.cos(phase), 0.85 + 0.08 * np.sin(phase)]
    return Pose(turn.as_matrix(), np.stack(position, -1))


def recording(rng) -> Recording:
    """Drawn frames of `motion`, and events at random."""
    e = np.zeros(4000, EVENT)
    e["t_us"] = np.sort(rng.integers(0, IMAGES * STEP_US, len(e)))
    e["x"], e["y"] = rng.integers(0, 128, len(e)), rng.integers(0, 96, len(e))
    track = Trajectory(STEP_US // 4 * np.arange(4 * IMAGES - 3), motion(4 * IMAGES - 3))
    frames = np.array([drawn.frame(T, rng, CAMERA) for T in motion(IMAGES)])
    return Recording("rig", CAMERA, e, frames, STEP_US * np.arange(IMAGES), track)


def write(folder: Path, rng) -> None:
    """All of it, in a folder that is there."""
    whole = standin.shift_time(recording(rng), standin.START_US)
    rig = folder / "rig"
    rig.mkdir()
    joints = ur5e.follow(standin.arm_poses(motion(IMAGES)))
    messages = tf.arm_messages(whole.frames_t_us, joints)
    rosbag_writer.write(whole, rig / "normal__train.bag", messages, calibrated=False)
    CAMERA.save(rig / "normal__train.camera.json")
    standin.write_hand_eye(rig / "hand-eye.yaml")
    standin.RIG.save(rig / "rig.json")
    e = whole.events[whole.events["t_us"] < whole.frames_t_us[SHORT]]
    short = replace(
        whole, name="r", events=e, frames=whole.frames[:SHORT], frames_t_us=whole.frames_t_us[:SHORT]
    )
    attack_sound.sound_files(folder, rng, short)
    attack_calls.SMALL.save(folder / "small.json")
    board = simulate_checkerboard(BOARD_CAMERA)
    rosbag_writer.write(board, folder / "board.bag", (), calibrated=False)
    BOARD_CAMERA.save(folder / "board.json")
    toy_training.write_samples(folder / "derived" / "training", rng)
    (folder / "one").mkdir()
    (folder / "one" / "0.png").write_bytes((folder / "pictures" / "0.png").read_bytes())
    with chdir(folder), redirect_stdout(StringIO()), redirect_stderr(StringIO()):
        for line in MADE.strip().splitlines():
            if code := main(line.split()):
                raise SystemExit(f"{line}: exit {code}")
