"""Frames, events and recordings of the port, drawn from its geometry alone: what the shipped networks see."""

from functools import cache

import cv2
import numpy as np
from strategies import CAMERA, PORT, moved, pose

from lmmap.geometry.port import ideal_masks
from lmmap.settings import PAPER
from lmmap.types import EVENT, Camera, Pose, Recording, Trajectory

DARK, BLUR_PX = 0.05, 0.6
STEP_US = 50_000  # from one frame to the next
START = pose((180, 120), 0.6, 0.5, 0.8, 0.3)
VELOCITY = np.array([0.10, 0.06, -0.08, 0.1, -0.15, 0.2])  # m/s and rad/s


def light(T: Pose, camera: Camera = CAMERA) -> np.ndarray:
    """Light (H, W) in [0.05, 1] of ring and markers before the dark, through a lens that blurs a little."""
    ring, markers = ideal_masks(T, PORT, camera, samples=2)
    return cv2.GaussianBlur(np.maximum(DARK, np.maximum(ring, markers)), (0, 0), BLUR_PX)


def frame(T: Pose, rng, camera: Camera = CAMERA) -> np.ndarray:
    """A noisy picture (H, W, 3) u8."""
    grey = 200 * light(T, camera)[..., None] + 2 * rng.standard_normal((*camera.size_px[::-1], 3))
    return grey.clip(0, 255).round().astype(np.uint8)


def events(poses, times_us, count: int, rng, camera: Camera = CAMERA) -> np.ndarray:
    """``count`` events between a pose and the next: where light changes, as often as its logarithm does."""
    lights, pieces = [np.log(light(T, camera)) for T in poses], []
    for k, change in enumerate(np.diff(lights, axis=0)):
        share = np.abs(change).ravel() / np.abs(change).sum()
        at = rng.choice(share.size, count, p=share)
        piece = np.zeros(count, EVENT)
        piece["y"], piece["x"] = np.unravel_index(at, change.shape)
        piece["p"] = change.ravel()[at] > 0
        piece["t_us"] = np.sort(rng.integers(times_us[k], times_us[k + 1], count))
        pieces.append(piece)
    return np.concatenate(pieces)


def true_pose(t_us: int) -> Pose:
    return moved(START, 1e-6 * t_us * VELOCITY)


@cache
def recording(frames: int = 12, seed: int = 0) -> Recording:
    """A port that drifts past the DAVIS, and its truth; between two frames there is one window of events."""
    rng, steps = np.random.default_rng(seed), 2 * (frames - 1)
    times_us = STEP_US // 2 * np.arange(steps + 1)
    poses = [true_pose(t) for t in times_us]
    e = events(poses, times_us, PAPER.events_per_window // 2, rng)
    pictures = np.array([frame(T, rng) for T in poses[::2]])
    together = Pose(np.stack([T.rotation for T in poses]), np.stack([T.position_m for T in poses]))
    return Recording("drawn", CAMERA, e, pictures, times_us[::2], Trajectory(times_us, together))
