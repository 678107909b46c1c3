"""Learning alone: networks from an image to a pose, without geometry but for the camera's rays.

A network answers with a rotation in the 6-D form (Zhou et al. 2019), turned as seen along the ray to the
port, with this ray and with the logarithm of the depth; and with the logarithm of a scale of the error of
each, which a Laplacian likelihood teaches it.  The rotation has three times the port's yaw: so a third of a
turn changes nothing, and the answer has no jump that a network could not learn.  Trained on the rotation
itself, with a loss that takes the nearest of three, networks learned positions but no yaw.
"""

from __future__ import annotations

import cv2
import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from lmmap.geometry.rotations import rotation_z
from lmmap.pipeline.network import CHANNELS, encode
from lmmap.settings import OURS
from lmmap.types import Camera, Port, Pose

from ..training.recipe import Recipe
from .samples import PosedSamples, turned_sample, varied_image, warp

STAGES = (1, 2, 4, 8, 8)  # channels after each halving of the image, in the first stage's
SMALL, LARGE = 32, 128  # channels of the first stage: as many weights as both filters have, and ten times
KEPT, HIDDEN, ANSWERS = 48, 256, 12
LOG_SCALES = -6.0, 3.0  # of errors
SIZE_PX = (256, 192)  # of the image that the network sees
TYPICAL_M = 0.64  # depth at which an untrained network sees the port
TURN = np.diag([1.0, -1.0, -1.0])  # and the rotation: head-on


class PoseNet(nn.Module):
    """Answers (N, 12) of images (N, C, H, W): two columns of the rotation, x / z, y / z and log z, and
    the logarithms of three scales."""

    def __init__(self, channels: int, width: int = SMALL, size_px=SIZE_PX, typical_m: float = TYPICAL_M):
        super().__init__()
        layers, last = [], channels
        for stage in STAGES:
            layers += [nn.Conv2d(last, stage * width, 3, 2, 1), nn.GroupNorm(8, stage * width), nn.ReLU()]
            last = stage * width
        cells = np.prod(size_px) // 4 ** len(STAGES)
        self.body = nn.Sequential(*layers, nn.Conv2d(last, KEPT, 1), nn.ReLU(), nn.Flatten())
        self.head = nn.Sequential(nn.Linear(KEPT * cells, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, ANSWERS))
        nn.init.zeros_(self.head[-1].weight)
        with torch.no_grad():
            self.head[-1].bias.copy_(
                torch.tensor([*TURN[:, 0], *TURN[:, 1], 0, 0, np.log(typical_m), 0, 0, 0])
            )

    def forward(self, x):
        seen = self.body(x).float()
        with torch.autocast(x.device.type, enabled=False):  # eight bits would round a pose
            return self.head(seen)


def network(modality: str, width: float = 1.0, channels: int = SMALL) -> PoseNet:
    """An untrained network."""
    return PoseNet(CHANNELS[modality], round(width * channels))


def rotations(columns: torch.Tensor) -> torch.Tensor:
    """Rotations (..., 3, 3) of their first two columns (..., 6), made orthonormal in their order."""
    x = F.normalize(columns[..., :3], dim=-1)
    y = F.normalize(columns[..., 3:] - (x * columns[..., 3:]).sum(-1, keepdim=True) * x, dim=-1)
    return torch.stack([x, y, torch.linalg.cross(x, y)], -1)


def differences(answers: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """How far answers (N, 12) are from truths (N, 9) in rotation, by Frobenius' norm, in ray and in logarithm
    of depth, (N, 3)."""
    apart = (rotations(answers[:, :6]) - rotations(truth[:, :6])).flatten(1).norm(dim=-1)
    ray = (answers[:, 6:8] - truth[:, 6:8]).norm(dim=-1)
    return torch.stack([apart, ray, (answers[:, 8] - truth[:, 8]).abs()], -1)


def pose_loss(answers: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """Mean negative logarithm of the Laplacian likelihood of truths (N, 9), less its constant."""
    log_scale = answers[:, 9:].clamp(*LOG_SCALES)
    return (differences(answers, truth) * torch.exp(-log_scale) + log_scale).sum(-1).mean()


def to_ray(position_m) -> np.ndarray:
    """The least rotation (3, 3) that takes the optical axis to the ray of a position."""
    x, y, z = np.asarray(position_m) / np.linalg.norm(position_m)
    return np.array([[1 - x * x / (1 + z), -x * y / (1 + z), x], [-x * y / (1 + z), 1 - y * y / (1 + z), y],
                     [-x, -y, z]])  # fmt: skip


def tripled(rotation: np.ndarray) -> np.ndarray:
    """A rotation (3, 3) with the same normal and three times the yaw, which counts from `_upright`."""
    upright = _upright(rotation[:, 2])
    return upright @ np.linalg.matrix_power(upright.T @ rotation, 3)


def thirded(rotation: np.ndarray) -> np.ndarray:
    """Inverse of `tripled`, up to a third of a turn."""
    upright = _upright(rotation[:, 2])
    yaw = upright.T @ rotation
    return upright @ rotation_z(np.arctan2(yaw[1, 0], yaw[0, 0]) / 3)


def _upright(normal) -> np.ndarray:
    """The head-on rotation, turned to a normal by the least rotation."""
    return to_ray(-normal) @ TURN


def encode_pose(T_cam_port: Pose) -> np.ndarray:
    """A pose as the network answers it, (9,) f32."""
    seen = tripled(to_ray(T_cam_port.position_m).T @ T_cam_port.rotation)
    x, y, z = T_cam_port.position_m
    return np.array([*seen[:, 0], *seen[:, 1], x / z, y / z, np.log(z)], np.float32)


def decode_pose(answer: np.ndarray) -> Pose:
    """Inverse of `encode_pose`, up to a third of a turn."""
    position_m = np.exp(float(answer[8])) * np.array([answer[6], answer[7], 1.0])
    seen = rotations(torch.tensor(np.asarray(answer[:6], float))).numpy()
    return Pose(to_ray(position_m) @ thirded(seen), position_m)


def shrink(image: np.ndarray) -> np.ndarray:
    """An image as the network sees it; a histogram's counts are added up, not averaged."""
    small = cv2.resize(image.astype(np.float32), SIZE_PX, interpolation=cv2.INTER_AREA)
    return small if image.ndim == 3 else small * (image.size / small.size)


def sample(samples: PosedSamples, recipe: Recipe, camera: Camera, rng) -> tuple[np.ndarray, np.ndarray]:
    """A varied image (192, 256, ...) and its truth (9,)."""
    image, mask, matrix, pose, _ = turned_sample(samples, recipe, camera, rng)
    image, mask = (warp(a, matrix, camera.size_px) for a in (image, mask))
    return shrink(varied_image(image, mask, recipe, rng)), encode_pose(pose)


def answer(net, image: np.ndarray, modality: str, camera: Camera, port: Port) -> tuple[Pose, float]:
    """The pose of an image, and the chance that the predicted errors keep to the limits of a right pose."""
    return read(net, shrink(image), modality)


def read(net, picture, modality, unit_m: float = 1.0) -> tuple[Pose, float]:
    values = net(encode(picture[None], modality))[0].double().numpy()
    pose = decode_pose(values)
    reach = OURS.right_position_m / (unit_m * pose.position_m[2])
    limits = np.array([2**0.5 * OURS.right_normal_rad, reach, reach])
    return pose, float(np.prod(1 - np.exp(-limits / np.exp(values[9:].clip(*LOG_SCALES)))))
