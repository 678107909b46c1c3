"""Learning alone, in two steps: a second network sees a crop about the pose that `regression` answers, as a
camera would that looks at the port, and corrects it."""

from __future__ import annotations

import cv2
import numpy as np
from torch import nn

from lmmap.pipeline.network import CHANNELS
from lmmap.types import Camera, Port, Pose

from ..training.recipe import Recipe
from .regression import SMALL, PoseNet, answer, encode_pose, read, to_ray
from .samples import PosedSamples, turned_sample, varied_image

SIZE_PX = (96, 96)
RING_M, RING_PX = Port.lm_map().ring_radius_m, 30.0  # radius of the ring, and in a crop
RAY_SIGMA, LOG_SIGMA = 0.03, 0.08  # of a crop's ray and depth from the true ones, in training
CROPS = 2  # each about the answer before it
UNTURNED = np.eye(3)


def network(modality: str, width: float = 1.0) -> PoseNet:
    """An untrained network for crops, to which the port is at a distance of about 1."""
    return PoseNet(CHANNELS[modality], round(width * SMALL), SIZE_PX, 1.0)


class Staged(nn.Module):
    """Both networks."""

    def __init__(self, whole: PoseNet, crop: PoseNet):
        super().__init__()
        self.whole, self.crop = whole, crop


def crop(image: np.ndarray, about_m: np.ndarray, camera: Camera, turned: np.ndarray = UNTURNED) -> np.ndarray:
    """What a camera sees that looks at a position, in which the ring has `RING_PX`, after ``turned`` (3, 3)
    has moved the image's pixels."""
    size = np.array(SIZE_PX)
    focal_px = RING_PX * np.linalg.norm(about_m) / RING_M
    K = np.array([[focal_px, 0, (size[0] - 1) / 2], [0, focal_px, (size[1] - 1) / 2], [0, 0, 1]])
    matrix = K @ to_ray(about_m).T @ np.linalg.inv(camera.K) @ turned
    seen = cv2.warpPerspective(image.astype(np.float32), matrix, SIZE_PX, flags=cv2.INTER_LINEAR)
    return seen if image.ndim == 3 else seen * (camera.fx_px / focal_px) ** 2


def in_crop(T_cam_port: Pose, about_m: np.ndarray) -> Pose:
    """A pose as the camera of `crop` sees it, in units of the distance that it expects."""
    R = to_ray(about_m).T
    return Pose(R @ T_cam_port.rotation, R @ T_cam_port.position_m / np.linalg.norm(about_m))


def from_crop(pose: Pose, about_m: np.ndarray) -> Pose:
    """Inverse of `in_crop`."""
    R = to_ray(about_m)
    return Pose(R @ pose.rotation, np.linalg.norm(about_m) * (R @ pose.position_m))


def sample(samples: PosedSamples, recipe: Recipe, camera: Camera, rng) -> tuple[np.ndarray, np.ndarray]:
    """A varied crop (96, 96, ...), not quite about the port, and its truth (9,)."""
    image, mask, matrix, pose, _ = turned_sample(samples, recipe, camera, rng)
    ray = pose.position_m / pose.position_m[2] + [*rng.normal(0, RAY_SIGMA, 2), 0]
    about_m = ray * pose.position_m[2] * np.exp(rng.normal(0, LOG_SIGMA))
    image, mask = (crop(a, about_m, camera, matrix) for a in (image, mask))
    return varied_image(image, mask, recipe, rng), encode_pose(in_crop(pose, about_m))


def answer_closely(net: Staged, image: np.ndarray, modality: str, camera: Camera, port: Port):
    """As `regression.answer`, by the first network and then by the second one."""
    pose, confidence = answer(net.whole, image, modality, camera, port)
    for _ in range(CROPS):
        about_m = pose.position_m
        unit_m = float(np.linalg.norm(about_m))
        seen, confidence = read(net.crop, crop(image, about_m, camera), modality, unit_m)
        pose = from_crop(seen, about_m)
    return pose, confidence
