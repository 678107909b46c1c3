"""Several looks at one image: what their poses say together.

Two looks use the same network, so their errors are correlated.  A look that agrees therefore counts for the
power ``look_independence`` of what an independent one would.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..geometry.rotations import angle_between_rad, rotation_between_rad
from ..settings import Settings
from ..types import Estimate, Port, Pose, Status
from .setup import Setup

IN_DOUBT = (Status.UNSURE, Status.NO_MARKERS)  # a ring is seen, and no pose is sure


def in_doubt(estimate: Estimate, settings: Settings) -> bool:
    """Whether an image shows a ring, but no pose that is sure enough after one look."""
    unsure = estimate.status == Status.OK and estimate.confidence < settings.sure_confidence
    return unsure or estimate.status in IN_DOUBT


def needs_more_events(estimate: Estimate, settings: Settings) -> bool:
    """Whether a histogram shows no pose, or none that is sure enough after one look."""
    return estimate.T_cam_port is None or in_doubt(estimate, settings)


def alike(a: Pose, b: Pose, port: Port, settings: Settings) -> bool:
    """Whether two poses differ by less than the errors of a pose that one may dock on."""
    return bool(
        np.linalg.norm(a.position_m - b.position_m) < settings.right_position_m
        and angle_between_rad(a.normal, b.normal) < settings.right_normal_rad
        and rotation_between_rad(a.rotation, b.rotation, port.yaw_period_rad) < settings.right_rotation_rad
    )


def joined_confidence(p: float, q: float, agree: bool, independence: float) -> float:
    """Probability that the first of two poses is right, given the probabilities p and q of each.

    Poses that agree are wrong only if both are: ``1 - (1 - p) (1 - q)^independence``.  If they disagree, at
    most one is right, which excludes that both are: ``p (1 - q) / (1 - p q)``.
    """
    if agree:
        return 1 - (1 - p) * (1 - q) ** independence
    return p * (1 - q) / max(1 - p * q, 1e-12)


def joined(estimates: Sequence[Estimate], setup: Setup) -> Estimate:
    """The answer of several looks at one image: the most confident pose, judged by the others, and reported
    if it reaches the modality's ``min_confidence``.  If none has a pose, the answer is the first look's."""
    settings = setup.settings
    with_pose = [e for e in estimates if e.found is not None]
    if len(with_pose) < 2:
        return with_pose[0] if with_pose else estimates[0]
    best = max(with_pose, key=lambda e: e.confidence)
    confidence = best.confidence
    for other in with_pose:
        if other is not best:
            assert best.found is not None and other.found is not None
            agree = alike(best.found, other.found, setup.port, settings)
            confidence = joined_confidence(confidence, other.confidence, agree, settings.look_independence)
    return best.judged(confidence, settings.min_confidence[setup.modality])
