"""What benchmarks compare with: eager float32 networks on full frames, and the paper's RANSAC as a loop."""

from __future__ import annotations

import numpy as np
import torch
from torch.nn import functional as F

from lmmap.geometry.conic_fit import sampson_distance
from lmmap.geometry.conics import conic_matrix, ellipse_from_conic, monomials
from lmmap.pipeline.network import STRIDE_PX, FilterNet, encode
from lmmap.pipeline.weights import FILTERS, load_filter, weight_path
from lmmap.settings import OURS, Settings
from lmmap.types import Ellipse


def nets(modality: str) -> list[FilterNet]:
    """Both filters' networks, in PyTorch's default layout."""
    return [load_filter(weight_path(name, modality), modality).eval() for name in FILTERS]


@torch.inference_mode()
def mask(net: FilterNet, image: np.ndarray, modality: str) -> np.ndarray:
    """ReLU before pooling, channels first, the whole frame."""
    x = encode(image[None], modality)
    height, width = x.shape[-2:]
    x = F.pad(x, (0, -width % STRIDE_PX, 0, -height % STRIDE_PX), mode="replicate")
    pooled = []
    for convolution in net.down:
        x = F.max_pool2d(F.relu(convolution(x)), 2)
        pooled.append(x)
    x = torch.cat([F.relu(net.up[0](x)), pooled[1]], 1)
    x = torch.cat([F.relu(net.up[1](x)), pooled[0]], 1)
    return torch.sigmoid(net.up[2](x)[0, 0, :height, :width]).numpy()


def ransac_loop(
    points_px: np.ndarray, rng: np.random.Generator, settings: Settings = OURS
) -> tuple[Ellipse | None, np.ndarray]:
    """The paper's loop, one hypothesis after the other: what `ellipse.paper_ransac` does at once."""
    equations = monomials(points_px)[:, :5]
    best = np.zeros(len(points_px), bool)
    for _ in range(settings.ransac_hypotheses):
        five = equations[rng.choice(len(points_px), 5, replace=False)]
        try:
            theta = np.append(np.linalg.solve(five, -np.ones(5)), 1.0)
        except np.linalg.LinAlgError:
            continue
        shape, real = ellipse_from_conic(conic_matrix(theta))
        if not real or shape.semi_axes_px[1] < settings.min_axis_ratio * shape.semi_axes_px[0]:
            continue
        inliers = np.abs(sampson_distance(theta, points_px)) < settings.ransac_tolerance_px
        if inliers.sum() > best.sum():
            best = inliers
    if not best.any():
        return None, best
    theta = np.append(np.linalg.lstsq(equations[best], -np.ones(best.sum()))[0], 1.0)
    shape, real = ellipse_from_conic(conic_matrix(theta))
    return (shape, best) if real else (None, np.zeros_like(best))
