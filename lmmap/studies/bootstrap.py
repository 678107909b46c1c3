"""Confidence intervals of statistics of a time series, by the bootstrap with blocks of time.

Neighbouring images see nearly the same view and err alike, so single images drawn anew would promise too
much.  Whole stretches are drawn instead (Politis & Romano 1992, circular blocks), within each sequence.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

LEVEL = 0.95


def block_counts(lengths: Sequence[int], block: int, draws: int, rng: np.random.Generator) -> np.ndarray:
    """How often each image is drawn, (draws, sum(lengths)), for sequences of so many images.

    Parameters
    ----------
    block : images in a block; at most a third of a sequence is taken, so that a short one varies at all
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
    """Medians (draws,) of values (N,) that count (draws, N) times; NaN values do not count."""
    values = np.asarray(values, float)
    order = np.argsort(values)[: np.isfinite(values).sum()]
    if not len(order):
        return np.full(len(counts), np.nan)
    below = np.cumsum(counts[:, order], 1)
    total, rows = below[:, -1:], np.arange(len(counts))
    middle = [values[order][np.argmax(below > k, 1)] for k in ((total - 1) // 2, total // 2)]
    return np.where(total[rows, 0] > 0, np.mean(middle, 0), np.nan)


def root_mean_squares(values, counts) -> np.ndarray:
    """Root mean squares (draws,), otherwise as `medians`."""
    values = np.asarray(values, float)
    known = np.isfinite(values)
    with np.errstate(invalid="ignore"):
        return np.sqrt(counts[:, known] @ values[known] ** 2 / counts[:, known].sum(1))


def shares(found, among, counts) -> np.ndarray:
    """Shares (draws,) of ``found`` (N,) among ``among`` (N,), both bool."""
    found, among = np.asarray(found, bool), np.asarray(among, bool)
    with np.errstate(invalid="ignore"):
        return counts @ (found & among).astype(float) / (counts @ among.astype(float))


def interval(statistics, level: float = LEVEL) -> tuple[float, float]:
    """Percentile interval of a statistic's draws (draws,); NaN of none."""
    known = np.asarray(statistics)[np.isfinite(statistics)]
    if not len(known):
        return np.nan, np.nan
    low, high = np.quantile(known, [(1 - level) / 2, (1 + level) / 2])
    return float(low), float(high)
