"""Learning, then PnP: a network marks points of the CAD, and PnP gives the pose.

The port looks the same after a third of a turn, so no image tells which of its markers is the first.  A
network that had to say so would learn a mean over all answers.  Here points that the symmetry takes into one
another are one class with one heatmap of three peaks: the four corners of a marker, and four places on the
ring's centre line.  Afterwards each peak's turn follows from its angle about the centre: with the peaks'
ellipse made round, a class is `symmetry` points at equal angles, and the first of them may be any.

The network is a U-Net (Ronneberger et al. 2015) that sees the whole port from each of its pixels.  One of the
layout of the pipeline's sees 22 pixels to each side, in which no place on the ring differs from the next.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise

import cv2
import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from lmmap.geometry.projection import project_points, undistort_points
from lmmap.pipeline.network import CHANNELS, encode
from lmmap.settings import OURS
from lmmap.types import Camera, Port, Pose

from ..training.recipe import Recipe
from .samples import PosedSamples, turned_sample, varied_image, warp

ON_RING = 0.0, 0.25, 0.5, 0.75  # places, as parts of the period, from a marker's direction
CLASSES = 4 + len(ON_RING)
WIDTHS, GROUPS = (48, 96, 128, 192, 192), 4  # channels after each halving of the image, and their norms
CROP_PX = 128  # of training, in which most of the port is seen
STRIDE_PX = 2  # of a heatmap
PEAK_SIGMA, LEAST_PEAK, PEAK_WINDOW = 1.0, 0.1, 5  # the first and the last in pixels of a heatmap
TOLERANCE_PX, LEAST_POINTS, LEAST_SIGMA_RAD = 3.0, 6, 1e-6  # of PnP's inliers, and of its rotation
PRIOR = 1e-3  # of a heatmap's pixels


@lru_cache
def points_m(port: Port) -> np.ndarray:
    """Points by class and turn in the port's frame, (CLASSES, symmetry, 3)."""
    turns = np.arange(port.symmetry) * port.yaw_period_rad
    ring = [
        port.ring_radius_m * np.stack([np.cos(turns + a), np.sin(turns + a), 0 * turns], -1)
        for a in port.yaw_period_rad * np.array(ON_RING)
    ]
    return np.concatenate([np.swapaxes(port.marker_corners_m(), 0, 1), ring])


class PointNet(nn.Module):
    """Logits (N, CLASSES, H / 2, W / 2), rounded up, of images (N, C, H, W)."""

    def __init__(self, channels: int, widths=WIDTHS):
        super().__init__()

        def step(layer):
            return nn.Sequential(layer, nn.GroupNorm(GROUPS, layer.out_channels), nn.ReLU())

        self.down = nn.ModuleList(step(nn.Conv2d(i, o, 3, 2, 1)) for i, o in pairwise((channels, *widths)))
        into = [widths[-1], *(2 * w for w in widths[-2::-1])]  # each but the first beside a skip connection
        self.up = nn.ModuleList(
            step(nn.ConvTranspose2d(i, o, 3, 2, 1, 1)) for i, o in zip(into[:-1], widths[-2::-1], strict=True)
        )
        self.last = nn.Conv2d(into[-1], CLASSES, 3, 1, 1)
        nn.init.constant_(self.last.bias, float(np.log(PRIOR / (1 - PRIOR))))

    def forward(self, x):
        height, width = x.shape[-2:]
        whole = 2 ** len(self.down)
        x = F.pad(x, (0, -width % whole, 0, -height % whole), mode="replicate")
        skipped = []
        for layer in self.down:
            x = layer(x)
            skipped.append(x)
        for layer, beside in zip(self.up, skipped[-2::-1], strict=True):
            x = torch.cat([layer(x), beside], 1)
        return self.last(x)[..., : -(-height // STRIDE_PX), : -(-width // STRIDE_PX)]


def network(modality: str, width: float = 1.0) -> PointNet:
    """An untrained network."""
    return PointNet(CHANNELS[modality], [round(width * w) for w in WIDTHS])


def sample(samples: PosedSamples, recipe: Recipe, camera: Camera, rng) -> tuple[np.ndarray, np.ndarray]:
    """A varied crop (S, S, ...), most of them at a point, and its heatmaps (CLASSES, S / 2, S / 2)."""
    image, mask, matrix, pose, port = turned_sample(samples, recipe, camera, rng)
    at = project_points(pose, points_m(port), camera)
    most = np.array(camera.size_px) - CROP_PX
    corner = rng.integers(0, most + 1)
    if rng.random() < recipe.positive_crops:
        chosen = at[rng.integers(CLASSES), rng.integers(at.shape[1])]
        corner = np.clip(np.rint(chosen) - rng.integers(0, CROP_PX, 2), 0, most).astype(int)
    matrix[:2] -= corner[:, None] * matrix[2]
    image, mask = (warp(a, matrix, (CROP_PX, CROP_PX)) for a in (image, mask))
    heat = heatmaps((at - corner) / STRIDE_PX, (CROP_PX // STRIDE_PX, CROP_PX // STRIDE_PX))
    return varied_image(image, mask, recipe, rng), heat


def heatmaps(points_px, shape: tuple[int, int]) -> np.ndarray:
    """Peaks of height 1 at points (K, S, 2), one heatmap a class, (K, H, W) f32."""
    across, down = (
        np.exp(-((np.arange(n, dtype=np.float32) - at[..., None]) ** 2) / (2 * PEAK_SIGMA**2))
        for n, at in zip(shape[::-1], np.moveaxis(np.nan_to_num(points_px, nan=np.inf), -1, 0), strict=True)
    )
    return (down[..., :, None] * across[..., None, :]).max(1).astype(np.float32)


def peaks(maps: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The ``count`` highest peaks of each heatmap (K, H, W): pixels (K, count, 2), NaN where there are fewer,
    and their heights (K, count)."""
    at, heights = np.full((len(maps), count, 2), np.nan), np.zeros((len(maps), count))
    window = np.ones((PEAK_WINDOW, PEAK_WINDOW), np.uint8)
    for k, values in enumerate(maps):
        v, u = np.nonzero((values == cv2.dilate(values, window)) & (values > LEAST_PEAK))
        highest = np.argsort(-values[v, u], kind="stable")[:count]
        v, u, found = v[highest], u[highest], slice(len(highest))
        log = np.log(np.pad(values, 1, mode="edge") + 1e-6)
        across, down = ([log[v + 1 + i, u + 1 + j] for i, j in ends]
                        for ends in (((0, -1), (0, 0), (0, 1)), ((-1, 0), (0, 0), (1, 0))))  # fmt: skip
        at[k, found] = np.stack([u + _top(*across), v + _top(*down)], -1)
        heights[k, found] = values[v, u]
    return at, heights


def _top(before, at, after) -> np.ndarray:
    """Where a parabola through three samples, of which the middle one is highest, is highest."""
    bend = before - 2 * at + after
    return np.divide(before - after, 2 * bend, out=np.zeros_like(bend), where=bend < 0).clip(-0.5, 0.5)


def assign(points_px: np.ndarray, port: Port) -> np.ndarray:
    """Which turn each peak (CLASSES, S, 2) of its class is, (CLASSES, S), all turned by some multiple of the
    port's period.  NaN peaks have any."""
    known = np.isfinite(points_px[..., 0])
    centred = points_px - points_px[known].mean(0)
    values, axes = np.linalg.eigh(np.cov(centred[known].T))
    x, y = np.moveaxis(centred @ (axes / np.sqrt(np.maximum(values, 1e-9))) @ axes.T, -1, 0)
    first = points_m(port)[:, :1]
    # the camera looks against the port's axis, so angles run the other way
    angle = np.where(known, -np.arctan2(y, x) - np.arctan2(first[..., 1], first[..., 0]), 0.0)
    common = np.angle(np.exp(1j * port.symmetry * angle[known]).sum()) / port.symmetry
    return np.rint((angle - common) / port.yaw_period_rad).astype(int) % port.symmetry


def solve(
    points_px: np.ndarray, heights: np.ndarray, port: Port, camera: Camera
) -> tuple[Pose, float] | None:
    """The pose by PnP of peaks (CLASSES, S, 2) of heights (CLASSES, S), and a confidence.

    The confidence is the chance that an error with a Laplacian distribution keeps to the limit of a right
    normal.  The distribution's scale is the rotation's standard deviation by PnP, divided by the mean height
    over all points of the CAD, of which those that were not found, or do not fit, count as zero.
    """
    known = np.isfinite(points_px[..., 0])
    if known.sum() < LEAST_POINTS:
        return None
    seen_px, turn = undistort_points(points_px, camera), assign(points_px, port)
    model = np.take_along_axis(points_m(port), turn[..., None], 1)
    found, rotation, position, inliers = cv2.solvePnPRansac(
        model[known], seen_px[known], camera.K, None, iterationsCount=200, reprojectionError=TOLERANCE_PX,
        confidence=0.999, flags=cv2.SOLVEPNP_SQPNP,
    )  # fmt: skip
    if not found or inliers is None or len(inliers) < LEAST_POINTS:
        return None
    fitting = inliers.ravel()
    used = model[known][fitting], seen_px[known][fitting]
    rotation, position = cv2.solvePnPRefineLM(*used, camera.K, None, rotation, position)
    pose = Pose(cv2.Rodrigues(rotation)[0], position.ravel())
    if pose.position_m[2] <= 0 or pose.normal @ pose.position_m >= 0:  # behind the camera, or turned away
        return None
    sigma_rad = _rotation_sigma_rad(*used, rotation, position, camera)
    height = min(heights[known][fitting].sum() / heights.size, 1.0)
    return pose, float(-np.expm1(-height * OURS.right_normal_rad / max(sigma_rad, LEAST_SIGMA_RAD)))


def _rotation_sigma_rad(model_m, seen_px, rotation, position, camera: Camera) -> float:
    """Standard deviation of a rotation that fits points (N, 3) to their pixels (N, 2), of all three angles
    together, from the scatter of the pixels about the fit."""
    fitted_px, slopes = cv2.projectPoints(model_m, rotation, position, camera.K, None)
    by_position = slopes[:, 3:6].reshape(-1, 2, 3)
    by_angle = np.cross((model_m @ cv2.Rodrigues(rotation)[0].T)[:, None], by_position)
    slopes = np.concatenate([by_angle, by_position], -1).reshape(-1, 6)
    variance_px2 = np.sum((fitted_px[:, 0] - seen_px) ** 2) / (len(slopes) - 6)
    return float(np.sqrt(variance_px2 * np.trace(np.linalg.inv(slopes.T @ slopes)[:3, :3])))


def answer(net, image: np.ndarray, modality: str, camera: Camera, port: Port) -> tuple[Pose, float] | None:
    """The pose of an image, and its confidence, as `solve`."""
    maps = torch.sigmoid(net(encode(image[None], modality)))[0].float().numpy()
    at, heights = peaks(maps, port.symmetry)
    return solve(STRIDE_PX * at, heights, port, camera)
