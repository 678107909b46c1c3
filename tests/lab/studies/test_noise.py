"""Noise of still pixels: the rate it was drawn with, whatever moves and whichever pixels are hot."""

import numpy as np
import pandas as pd
import pytest

from lmmap.types import EVENT, Camera, Recording
from lmmap_lab.bench.event_sensor import SensorSettings
from lmmap_lab.studies import noise


def recorded(rates_hz, seconds, rng):
    """A recording whose pixels fire by chance at these rates (H, W)."""
    camera = Camera.davis346()
    counts = rng.poisson(rates_hz * seconds)
    pixels = np.repeat(np.arange(counts.size), counts.ravel())
    events = np.zeros(len(pixels), EVENT)
    events["t_us"] = np.sort(rng.integers(0, int(seconds * 1e6), len(pixels)))
    events["y"], events["x"] = np.divmod(rng.permutation(pixels), camera.width_px)
    return Recording("drawn", camera, events, np.empty((0, 260, 346, 3), np.uint8), np.empty(0, np.int64))


@pytest.mark.parametrize("rate_hz, moving_hz, for_s", [(0.05, 2.0, 40.0), (0.5, 20.0, 8.0), (5.0, 20.0, 4.0)])
def test_the_rate_is_that_of_the_still_pixels(rate_hz, moving_hz, for_s):
    """Half of the image moves and a pixel in a thousand is hot; neither counts."""
    rng = np.random.default_rng(1)
    rates_hz = np.full((260, 346), rate_hz)
    rates_hz[:, :173] += moving_hz
    rates_hz[rng.random(rates_hz.shape) < 1e-3] = 200.0
    counts, seconds = noise.event_counts(recorded(rates_hz, for_s, rng))
    assert noise.background_hz(counts, seconds) == pytest.approx(rate_hz, rel=0.15)


def test_the_committed_table_says_that_noise_hides_the_port():
    table = pd.read_csv(noise.COMMITTED)
    bench = table[table.source == "bench"]
    assert SensorSettings().shot_hz in set(bench.shot_hz)
    assert np.corrcoef(bench.background_hz.rank(), bench.ellipse_percent.rank())[0, 1] < -0.8
    assert (table.source != "bench").any()


def test_a_crossing_is_between_the_points_around_it():
    assert noise.crossing([0, 1, 3], [90, 40, 0], 20) == pytest.approx(2.0)
    assert np.isnan(noise.crossing([0, 1], [90, 40], 20))
