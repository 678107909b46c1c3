"""What fits the confidence: the pose of each look at an image, its evidence, and that of wrong poses."""

from __future__ import annotations

from typing import NamedTuple
from unittest import mock

import judged_images
import numpy as np
import wrong_poses
from choose_thresholds import right
from scipy.spatial.transform import Rotation

from lmmap.evaluation.pose_errors import normal_error_rad, position_error_m
from lmmap.refinement import verify
from lmmap.settings import OURS, Settings
from lmmap.types import Estimate, Pose
from lmmap_lab.studies.sequence_files import looks_of

MISPLACED_RAD = np.deg2rad(10)


class Witness(wrong_poses.OnMasks):
    """An estimator that reports every pose, and keeps its evidence and that of misplaced ones."""

    def __init__(self, modality: str, settings: Settings):
        self.kept: dict = {}  # shared with the estimator of turned images
        super().__init__(modality, settings)

    def on_grid(self, image, t_us=0, near=None) -> Estimate:
        weigh = verify.evidence

        def witnessed(T_cam_port, *about):
            self.kept["evidence"] = weigh(T_cam_port, *about)
            self.kept["misplaced"] = [weigh(T, *about) for T in misplaced(T_cam_port, self.port)]
            return self.kept["evidence"]

        with mock.patch.object(verify, "evidence", witnessed):
            return super().on_grid(image, t_us, near)


def misplaced(T_cam_port: Pose, port) -> list[Pose]:
    """A pose turned by `MISPLACED_RAD` about four axes in the ring's plane, then by half a yaw period."""
    x, y, normal = T_cam_port.rotation.T
    turns = [MISPLACED_RAD * axis for axis in (x, -x, y, -y)] + [port.yaw_period_rad / 2 * normal]
    rotations = Rotation.from_rotvec(turns).as_matrix() @ T_cam_port.rotation
    return [Pose(R, T_cam_port.position_m) for R in rotations]


class Sight(NamedTuple):
    """The estimate of one look; where it has a pose also the evidence (6,), that of misplaced ones (5, 6),
    and whether circle and pose are right."""

    estimate: Estimate
    evidence: np.ndarray | None = None
    misplaced: list | None = None
    circle_right: bool = False
    right: bool = False


class Sights(NamedTuple):
    """All looks at an image: at N events and at more, each as it is and with its half turn."""

    set: str
    sequence: str
    light: str
    modality: str
    weights: str
    looks: list[tuple[Sight, ...]]


def sights(set_name: str, modality: str, weights: str) -> list[Sights]:
    """What each look at the images of a set says."""
    witness, rows = Witness(modality, looks_of(weights, wrong_poses.EVERY_POSE)), []
    ways = [witness.once, *([witness.once_turned] if witness.settings.turned_look else [])]
    for case in judged_images.cases(set_name, modality, weights):
        looks = [tuple(_sight(witness, way(look), look.truth) for way in ways) for look in case.looks]
        rows.append(Sights(set_name, case.name, case.light, modality, weights, looks))
    return rows


def _sight(witness: Witness, estimate: Estimate, truth: Pose) -> Sight:
    T = estimate.T_cam_port
    if T is None:
        return Sight(estimate)
    circle_right = (position_error_m(T, truth) < OURS.right_position_m
                    and normal_error_rad(T, truth) < OURS.right_normal_rad)  # fmt: skip
    return Sight(estimate, *witness.kept.values(), bool(circle_right), right(T, truth, judged_images.PORT))
