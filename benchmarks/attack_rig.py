"""A sound laboratory, which the attack suite damages: a bag whose arm moves the port before the camera, the
hand-eye file that says where the camera stands, and the rig."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from lmmap.types import EVENT, Camera, Port, Pose, Recording
from lmmap_lab.bench import laboratory, optics, renderer, rosbag_writer
from lmmap_lab.rig import standin, tf, ur5e

CAMERA = Camera(128, 96, 324.0, 324.0, 63.5, 47.5)
IMAGES, STEP_US = 26, 100_000  # a calibration needs 20 detections


def motion(count: int) -> Pose:
    """``T_cam_port`` (count,) of a port that turns about two axes, a ring of some 50 px."""
    phase = np.linspace(0, 2 * np.pi, count)
    tilt = np.stack([0.35 * np.cos(phase), 0.35 * np.sin(2 * phase), 0 * phase], -1)
    facing = Rotation.from_rotvec([np.pi, 0, 0])
    turn = Rotation.from_rotvec(tilt) * facing * Rotation.from_rotvec(np.outer(phase / 6, [0, 0, 1]))
    position = [0.02 * np.sin(3 * phase), 0.01 * np.cos(phase), 0.85 + 0.08 * np.sin(phase)]
    return Pose(turn.as_matrix(), np.stack(position, -1))


def recording(rng) -> Recording:
    """Rendered frames of `motion`, and events at random."""
    seq, port = laboratory.sequence("realistic-1"), Port.lm_map()
    solid, skin = laboratory.panel(seq, port)
    lamps, rays = laboratory.lamps(seq), renderer.ray_grid(CAMERA, 1)
    backdrop = laboratory.backdrop(seq, CAMERA, lamps.intensity[:, 0].sum())
    frames = [
        optics.expose(optics.apply_lens(radiance, 0.6), laboratory.GAIN, rng)
        for T in motion(IMAGES)
        for radiance in [renderer.render(solid, skin, lamps, T, rays, backdrop)[0]]
    ]
    e = np.zeros(4000, EVENT)
    e["t_us"] = np.sort(rng.integers(0, IMAGES * STEP_US, len(e)))
    e["x"], e["y"] = rng.integers(0, 128, len(e)), rng.integers(0, 96, len(e))
    return Recording("rig", CAMERA, e, np.array(frames), STEP_US * np.arange(IMAGES))


def write(folder: Path, rng) -> dict[str, Path]:
    """The bag, its camera, the hand-eye file and the rig, in a folder of their own."""
    folder = folder / "rig"
    folder.mkdir()
    r, path = standin.shift_time(recording(rng), standin.START_US), folder / "normal__train.bag"
    joints = ur5e.follow(standin.arm_poses(motion(IMAGES)))
    rosbag_writer.write(r, path, tf.arm_messages(r.frames_t_us, joints), calibrated=False)
    CAMERA.save(path.with_suffix(".camera.json"))
    standin.write_hand_eye(folder / "hand-eye.yaml")
    standin.RIG.save(folder / "rig.json")
    return {"rig.bag": path, "hand-eye.yaml": folder / "hand-eye.yaml", "rig.json": folder / "rig.json"}
