"""The block bootstrap: it draws whole stretches, its statistics are the plain ones, its intervals hold."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import seeds

from lmmap_lab.studies import bootstrap

LENGTHS = st.lists(st.integers(1, 40), min_size=1, max_size=4)


@given(LENGTHS, st.integers(1, 60), seeds())
def test_every_draw_has_as_many_images_of_each_sequence(lengths, block, seed):
    counts = bootstrap.block_counts(lengths, block, 8, np.random.default_rng(seed))
    assert counts.shape == (8, sum(lengths)) and counts.min() >= 0
    for part, n in zip(np.split(counts, np.cumsum(lengths)[:-1], 1), lengths, strict=True):
        assert (part.sum(1) == n).all()


def test_neighbours_are_drawn_together():
    """In blocks of 10 an image nearly always comes with its neighbour; one by one, as chance has it."""
    together = {}
    for block in (1, 10):
        counts = bootstrap.block_counts([300], block, 400, np.random.default_rng(0))
        together[block] = np.corrcoef(counts[:, :-1].ravel(), counts[:, 1:].ravel())[0, 1]
    assert abs(together[1]) < 0.05 and together[10] == pytest.approx(0.9, abs=0.05)


@given(st.lists(st.one_of(st.floats(-9, 9), st.just(np.nan)), min_size=1, max_size=12), seeds())
def test_statistics_are_those_of_the_images_drawn(values, seed):
    rng = np.random.default_rng(seed)
    values, counts = np.array(values), rng.integers(0, 4, (5, len(values)))
    flags, among = rng.random((2, len(values))) < 0.5
    for k, times in enumerate(counts):
        drawn = np.repeat(values, times)
        drawn = drawn[np.isfinite(drawn)]
        expected = (np.median(drawn), np.sqrt(np.mean(drawn**2))) if drawn.size else (np.nan, np.nan)
        computed = bootstrap.medians(values, counts)[k], bootstrap.root_mean_squares(values, counts)[k]
        np.testing.assert_allclose(computed, expected, atol=1e-12)
        counted = np.repeat(among, times)
        share = (np.repeat(flags, times) & counted).sum() / counted.sum() if counted.any() else np.nan
        np.testing.assert_allclose(bootstrap.shares(flags, among, counts)[k], share)


def test_the_interval_of_correlated_errors_holds_their_median():
    """A slow random walk around 0: single images promise too much, blocks keep their 95 %."""
    rng, held = np.random.default_rng(1), {1: [], 60: []}
    for _ in range(120):
        noise = np.convolve(rng.standard_normal(1019), np.ones(20) / np.sqrt(20), "valid")
        for block, hits in held.items():
            counts = bootstrap.block_counts([1000], block, 200, rng)
            low, high = bootstrap.interval(bootstrap.medians(noise, counts))
            hits.append(low <= 0 <= high)
    assert np.mean(held[1]) < 0.6 and 0.86 < np.mean(held[60]) <= 1


def test_of_nothing_comes_nothing():
    assert np.isnan(bootstrap.interval(np.full(3, np.nan))).all()
    assert bootstrap.block_counts([], 5, 3, np.random.default_rng(0)).shape == (3, 0)
    with pytest.raises(ValueError, match="at least 1"):
        bootstrap.block_counts([10], 0, 3, np.random.default_rng(0))
