"""Small recordings of a place in which some images are hard: a bright pattern lies over the port."""

from functools import cache

import cv2
import drawn
import numpy as np
from strategies import moved, pose

from lmmap.types import EVENT, Camera, Pose, Recording, Trajectory

CAMERA = Camera(184, 136, 324.0, 324.0, 91.5, 67.5)
START = pose((88, 66), 0.75, 0.4, 0.8, 0.3, camera=CAMERA)
STEP = np.array([0.0016, 0.0008, -0.004, 0.006, -0.008, 0.01])
DECOY = pose((30, 40), 1.3, 0.2, camera=CAMERA)  # a port of another size, which stands still
FRAMES, STEP_US = 24, 50_000
HARD, GLARE, GAIN = 2, 2.4, 75.0  # every so many images; how bright, and grey levels, of a ring's light


def true_poses() -> Pose:
    poses = [moved(START, k * STEP) for k in range(FRAMES)]
    return Pose(np.stack([T.rotation for T in poses]), np.stack([T.position_m for T in poses]))


@cache
def recording(port: bool = True, decoy: bool = False) -> Recording:
    """Frames of the port, or of the place without it; with something like it elsewhere."""
    rng, frames = np.random.default_rng(3), []
    pattern = (rng.random((CAMERA.height_px // 8, CAMERA.width_px // 8)) > 0.6).astype(np.float32)
    glare = GLARE * cv2.resize(pattern, CAMERA.size_px, interpolation=cv2.INTER_LINEAR)
    poses = true_poses()
    for k in range(FRAMES):
        light = drawn.light(poses[k], CAMERA) if port else np.full(glare.shape, drawn.DARK, np.float32)
        light = np.maximum(light, drawn.light(DECOY, CAMERA)) if decoy else light
        light = light + np.roll(glare, k, 1) if k % HARD == HARD - 1 else light
        noisy = GAIN * light[..., None] + 2 * rng.standard_normal((*light.shape, 3))
        frames.append(noisy.clip(0, 255).round().astype(np.uint8))
    times_us = STEP_US * np.arange(FRAMES, dtype=np.int64)
    truth = Trajectory(times_us, poses) if port else None
    return Recording("place", CAMERA, np.empty(0, EVENT), np.array(frames), times_us, truth)
