"""Estimates of a port that drifts past a camera, with errors and mistakes that a test chooses."""

import numpy as np
from strategies import moved, pose

from lmmap.types import Estimate, Pose, Status

START, STEP = pose((170, 125), 0.6, 0.4, 0.8, 0.3), np.array([0.001, 0.0005, -0.002, 0.003, -0.004, 0.005])
STEP_US = 50_000
COVARIANCE = np.diag([1e-6, 1e-6, 4e-6, 1e-4, 1e-4, 1e-4])


def true_pose(k: float) -> Pose:
    """Where the port is at the time of image ``k``."""
    return moved(START, k * STEP)


def estimate(k: int, T: Pose | None, confidence: float = 0.97) -> Estimate:
    """An image's estimate, or that of an image without a pose."""
    if T is None:
        return Estimate(k * STEP_US, Status.NO_ELLIPSE)
    return Estimate(k * STEP_US, Status.OK, T, covariance=COVARIANCE, confidence=confidence)


def wrong(T: Pose, rng) -> Pose:
    """A pose some centimetres and tens of degrees beside another."""
    aside_m, turn_rad = rng.normal(size=3), rng.normal(size=3)
    step = np.concatenate(
        [0.06 * aside_m / np.linalg.norm(aside_m), 0.5 * turn_rad / np.linalg.norm(turn_rad)]
    )
    return moved(T, step)


def told(estimates) -> list:
    """What a track takes."""
    return [("rgb", e) for e in estimates]
