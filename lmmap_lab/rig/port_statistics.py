"""Which edges and images count when a port is measured, and how far its dimensions can be trusted."""

from __future__ import annotations

import numpy as np

from .port_outline import KINDS, kinds_of

LEAST_SIGMA_PX = 0.05  # of a measured edge
TUKEY = 4.7  # standard deviations beyond which a residual counts for nothing
BAD_IMAGE = 3.0  # times the typical residual: the image shows another pose than its start
LEAST_SHARE = 0.3  # of the edges of ring and of markers, without which an image counts for nothing


def weights(residual):
    """Tukey's weights (N, K) over each kind's variance, 0 where nothing is measured; the ratio of their sum
    to that of the influence's derivative; the kinds' standard deviations (2,) px; the images kept (N,)."""
    seen, kinds = np.isfinite(residual), kinds_of(residual.shape[1])
    size, sigma_px, kept = np.where(seen, np.abs(residual), np.inf), np.zeros(KINDS), np.ones(len(seen), bool)
    for kind in range(KINDS):
        own, own_seen = size[:, kinds == kind], seen[:, kinds == kind]
        typical_px = np.median(own[own_seen]) if own_seen.any() else 0.0
        sigma_px[kind] = max(1.48 * typical_px, LEAST_SIGMA_PX)
        median_px = np.array(
            [np.median(row[row < np.inf]) if (row < np.inf).any() else np.inf for row in own]
        )
        kept &= (median_px < BAD_IMAGE * sigma_px[kind] / 1.48) & (own_seen.mean(1) > LEAST_SHARE)
    u2 = np.minimum(size / (TUKEY * sigma_px[kinds]), 1.0) ** 2
    weight, slope = (part * sigma_px[kinds] ** -2.0 for part in ((1 - u2) ** 2, (1 - u2) * (1 - 5 * u2)))
    return weight, weight[kept].sum() / max(slope[kept].sum(), 1e-12), sigma_px, kept


def covariance(S, score, precision, bend: float) -> np.ndarray:
    """Of what all images share, by how the images' own scores (N, Q) scatter: S^-1 (sum s s') S^-1.

    Errors of one image's edges are alike, so an image counts as one observation, not as its hundreds of
    edges; errors that images share are not seen.  S has Tukey's weights, and ``bend`` corrects it to the
    influence's derivative.  What no image determines keeps the variance that it had before.
    """
    meat = score.T @ score * (len(score) / max(len(score) - 1, 1) * bend**2) + precision
    return solve(S, solve(S, meat).T)


def solve(S, right) -> np.ndarray:
    """S^-1 right, by a matrix of unit diagonal: metres stand beside pixels in S."""
    scale = S.diagonal() ** -0.5
    return (np.linalg.solve(S * np.outer(scale, scale), (right.T * scale).T).T * scale).T
