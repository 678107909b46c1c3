"""Learning, then PnP: a network of the pipeline's layout marks points of the CAD, and PnP gives the pose.

The port looks the same after a third of a turn, so no image tells which of its markers is the first.  A
network that had to say so would learn a mean over all answers.  Here points that the symmetry takes into one
another are one class with one heatmap of three peaks: the four corners of a marker, which differ within a
small window of the image, and the ring's middle line beside a marker and between two.  Afterwards each
peak's turn follows from its angle about the centre: with the peaks' ellipse made round, a class is `symmetry`
points at equal angles, and the first of them may be any.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from lmmap.geometry.projection import project_points, undistort_points
from lmmap.pipeline.network import CHANNELS, STRIDE_PX, WIDTHS, FilterNet, encode
from lmmap.types import Camera, Port, Pose

from ..training.batches import events_of, vary
from ..training.recipe import Recipe
from .samples import PosedSamples

CLASSES, MIRRORED = 6, [3, 2, 1, 0, 4, 5]  # the latter: what a mirror makes of each class
PEAK_SIGMA_PX, LEAST_PEAK, PEAK_WINDOW = 1.5, 0.1, 5
TOLERANCE_PX, LEAST_POINTS = 3.0, 6  # of PnP's inliers
PRIOR = 1e-3  # of a heatmap's pixels


@lru_cache
def points_m(port: Port) -> np.ndarray:
    """Points by class and turn in the port's frame, (CLASSES, symmetry, 3)."""
    turns = np.arange(port.symmetry) * port.yaw_period_rad
    ring = [
        port.ring_radius_m * np.stack([np.cos(turns + a), np.sin(turns + a), 0 * turns], -1)
        for a in (0, port.yaw_period_rad / 2)
    ]
    return np.concatenate([np.swapaxes(port.marker_corners_m(), 0, 1), ring])


class PointNet(FilterNet):
    """Logits (N, CLASSES, H, W): `FilterNet` with another last layer."""

    def __init__(self, channels: int, prior: float = PRIOR, widths=WIDTHS):
        super().__init__(channels, prior, widths)
        first = self.up[2]
        self.up[2] = nn.ConvTranspose2d(first.in_channels, CLASSES, first.kernel_size, first.stride,
                                        first.padding, first.output_padding)  # fmt: skip
        nn.init.kaiming_normal_(self.up[2].weight)
        nn.init.constant_(self.up[2].bias, first.bias.item())

    def forward(self, x):
        height, width = x.shape[-2:]
        x = F.pad(x, (0, -width % STRIDE_PX, 0, -height % STRIDE_PX), mode="replicate")
        pooled = []
        for convolution in self.down:
            x = F.relu(F.max_pool2d(convolution(x), 2))
            pooled.append(x)
        x = torch.cat([F.relu(self.up[0](x)), pooled[1]], 1)
        x = torch.cat([F.relu(self.up[1](x)), pooled[0]], 1)
        return self.up[2](x)[..., :height, :width]


def network(modality: str, width: float = 1.0) -> PointNet:
    """An untrained network."""
    return PointNet(CHANNELS[modality], widths=[round(width * w) for w in WIDTHS])


def sample(samples: PosedSamples, recipe: Recipe, camera: Camera, rng) -> tuple[np.ndarray, np.ndarray]:
    """A varied crop (S, S, ...), most of them at a point, and its heatmaps (CLASSES, S, S)."""
    index, other, size = rng.integers(len(samples)), rng.integers(len(samples)), recipe.crop_px
    events = events_of(recipe, rng)
    at = project_points(samples.pose(index), points_m(samples.port(index)), camera)
    most = np.array(camera.size_px) - size
    corner = rng.integers(0, most + 1)
    if rng.random() < recipe.positive_crops:
        chosen = at[rng.integers(CLASSES), rng.integers(at.shape[1])]
        corner = np.clip(np.rint(chosen) - rng.integers(0, size, 2), 0, most).astype(int)
    window = tuple(slice(a, a + size) for a in corner[::-1])
    image, mask, cover = (a[window] for a in (samples.image(index, events), samples.mask(index),
                                              samples.image(other, events)))  # fmt: skip
    cover = (
        np.zeros(image.shape, np.float32) if samples.mask(other)[window].any() else cover.astype(np.float32)
    )
    heat = heatmaps(at - corner, (size, size))
    turns, mirror = rng.integers(4), rng.random() < 0.5
    image, mask = (np.rot90(a, turns) for a in (image.astype(np.float32), mask))
    heat = np.rot90(heat, turns, (1, 2))
    if mirror:
        image, mask, heat = image[:, ::-1], mask[:, ::-1], heat[MIRRORED, :, ::-1]
    image, mask = (np.ascontiguousarray(a) for a in (image, mask))
    return vary(image, mask, cover, recipe, rng)[0], heat


def heatmaps(points_px, shape: tuple[int, int]) -> np.ndarray:
    """Peaks of height 1 at points (K, S, 2), one heatmap a class, (K, H, W) f32."""
    across, down = (
        np.exp(-((np.arange(n, dtype=np.float32) - at[..., None]) ** 2) / (2 * PEAK_SIGMA_PX**2))
        for n, at in zip(shape[::-1], np.moveaxis(np.nan_to_num(points_px, nan=np.inf), -1, 0), strict=True)
    )
    return (down[..., :, None] * across[..., None, :]).max(1).astype(np.float32)


def peaks(maps: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """The ``count`` highest peaks of each heatmap (K, H, W): pixels (K, count, 2), NaN where there are fewer,
    and their heights (K, count)."""
    at, heights = np.full((len(maps), count, 2), np.nan), np.zeros((len(maps), count))
    for k, values in enumerate(maps):
        window = np.ones((PEAK_WINDOW, PEAK_WINDOW), np.uint8)
        v, u = np.nonzero((values == cv2.dilate(values, window)) & (values > LEAST_PEAK))
        highest = np.argsort(-values[v, u], kind="stable")[:count]
        for n, (y, x) in enumerate(zip(v[highest], u[highest], strict=True)):
            rows, columns = (slice(max(c - 2, 0), c + 3) for c in (y, x))
            weight = values[rows, columns] + 1e-9
            grid = np.mgrid[rows.start : rows.start + weight.shape[0],
                            columns.start : columns.start + weight.shape[1]]  # fmt: skip
            at[k, n] = np.average(grid.reshape(2, -1)[::-1], axis=1, weights=weight.ravel())
            heights[k, n] = values[y, x]
    return at, heights


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
    """The pose by PnP of peaks (CLASSES, S, 2) of heights (CLASSES, S), and a confidence: the mean height
    over all points of the CAD, of which those that were not found, or do not fit, count as zero."""
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
    rotation, position = cv2.solvePnPRefineLM(model[known][fitting], seen_px[known][fitting], camera.K, None,
                                              rotation, position)  # fmt: skip
    pose = Pose(cv2.Rodrigues(rotation)[0], position.ravel())
    if pose.position_m[2] <= 0 or pose.normal @ pose.position_m >= 0:  # behind the camera, or turned away
        return None
    return pose, float(min(heights[known][fitting].sum() / heights.size, 1.0))


def answer(net, image: np.ndarray, modality: str, camera: Camera, port: Port) -> tuple[Pose, float] | None:
    """The pose of an image, and its confidence, as `solve`."""
    maps = torch.sigmoid(net(encode(image[None], modality)))[0].float().numpy()
    return solve(*peaks(maps, port.symmetry), port, camera)
