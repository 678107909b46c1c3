"""Confidence intervals of statistics of a time series, by the bootstrap with blocks of time.

Neighbouring images show nearly the same view and have similar errors, so drawing single images would give
too narrow intervals.  Instead, whole stretches of each sequence are drawn (circular blocks, Politis & Romano
1992).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

LEVEL = 0.95


def block_counts(lengths: Sequence[int], block: int, draws: int, rng: np.random.Generator) -> np.ndarray:
    """How often each image is drawn, (draws, sum(lengths)), for sequences of ``lengths`` images.

    Parameters
    ----------
    block : images in a block, but at most a third of a sequence, so that a short sequence varies at all
    """
    if block < 1 or min(lengths, default=1) < 1:
        raise ValueError(f"block, lengths: expected at least 1, got {block}, {list(lengths)}")
    parts = [np.zeros((draws, 0), np.int32)]
    for n in lengths:
        size = max(min(block, n // 3), 1)
        blocks = -(-n // size)
        starts = rng.integers(0, n, (draws, blocks))
        index = ((starts[..., None] + np.arange(size)) % n).reshape(draws, blocks * size)[:, :n]
        flat = (index + n * np.arange(draws)[:, None]).ravel()
        parts.append(np.bincount(flat, minlength=draws * n).reshape(draws, n).astype(np.int32))
    return np.concatenate(parts, 1)


def medians(values, counts) -> np.ndarray:
    """Medians (draws,) of ``values`` (N,), each taken ``counts`` (draws, N) times, without NaN values."""
    values = np.asarray(values, float)
    order = np.argsort(values)[: np.isfinite(values).sum()]
    if not len(order):
        return np.full(len(counts), np.nan)
    below = np.cumsum(counts[:, order], 1)
    total, rows = below[:, -1:], np.arange(len(counts))
    middle = [values[order][np.argmax(below > k, 1)] for k in ((total - 1) // 2, total // 2)]
    return np.where(total[rows, 0] > 0, np.mean(middle, 0), np.nan)


def root_mean_squares(values, counts) -> np.ndarray:
    """Root mean squares (draws,) of ``values`` (N,), with the arguments of `medians`."""
    values = np.asarray(values, float)
    known = np.isfinite(values)
    with np.errstate(invalid="ignore"):
        return np.sqrt(counts[:, known] @ values[known] ** 2 / counts[:, known].sum(1))


def shares(members, images, counts) -> np.ndarray:
    """Shares (draws,) of ``members`` (N,) among ``images`` (N,), both bool; NaN of no image."""
    members, images = np.asarray(members, bool), np.asarray(images, bool)
    with np.errstate(invalid="ignore"):
        return counts @ (members & images).astype(float) / (counts @ images.astype(float))


def interval(statistics, level: float = LEVEL) -> tuple[float, float]:
    """Percentile interval (lower, upper) of a statistic's draws (draws,); NaN if none is finite."""
    known = np.asarray(statistics)[np.isfinite(statistics)]
    if not len(known):
        return np.nan, np.nan
    lower, upper = np.quantile(known, [(1 - level) / 2, (1 + level) / 2])
    return float(lower), float(upper)
