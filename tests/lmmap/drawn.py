"""Frames, events and recordings of the port, drawn from its geometry alone: what the shipped networks see."""

import atexit
import shutil
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import cv2
import numpy as np
from library_files import write_recording
from strategies import CAMERA, PORT, moved, pose

from lmmap.geometry.port import ideal_masks
from lmmap.settings import PAPER
from lmmap.types import EVENT, Camera, Pose, Recording, Trajectory

DARK, BLUR_PX = 0.05, 0.6
STEP_US = 50_000  # from one frame to the next, unless a recording is to take longer
START = pose((180, 120), 0.6, 0.5, 0.8, 0.3)
STEP = np.array([0.005, 0.003, -0.004, 0.005, -0.0075, 0.01])  # in m and rad, from frame to frame


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


@cache
def recording(frames: int = 12, step_us: int = STEP_US) -> Recording:
    """A port that drifts past the DAVIS, and its truth; between two frames there is one window of events."""
    rng, halves = np.random.default_rng(0), np.arange(2 * frames - 1)
    times_us, poses = step_us // 2 * halves, [moved(START, k / 2 * STEP) for k in halves]
    e = events(poses, times_us, PAPER.events_per_window // 2, rng)
    pictures = np.array([frame(T, rng) for T in poses[::2]])
    together = Pose.stack(poses)
    return Recording("drawn", CAMERA, e, pictures, times_us[::2], Trajectory(times_us, together))


@cache
def file(frames: int = 12, step_us: int = STEP_US) -> Path:
    """The recording as AEDAT4 beside its camera and truth, until this process ends."""
    # A TemporaryDirectory would remove itself in forked processes, in which Python 3.13 empties atexit.
    folder = mkdtemp(prefix="drawn-")
    atexit.register(shutil.rmtree, folder)
    path = Path(folder) / "drawn.aedat4"
    write_recording(recording(frames, step_us), path)
    return path
