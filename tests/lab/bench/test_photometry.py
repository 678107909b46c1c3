"""Saturated shares by hand, and the committed strengths against the rows that they were set to."""

import json

import numpy as np
import pytest

from lmmap.types import Camera, Port
from lmmap_lab.bench import laboratory, photometry
from lmmap_lab.provenance import DATA


def test_shares_by_hand():
    frame = np.full((4, 5, 3), 100, np.uint8)
    frame[1, 1], frame[1, 2], frame[2, 1] = 0, (9, 9, 10), (0, 0, 250)  # brightest channel: 0, 10, 250
    region = np.zeros((4, 5), bool)
    region[1, 1] = region[2, 2] = True  # a box of 2 x 2
    assert photometry.roi_saturation_percent(frame, region) == (25.0, 25.0)


def test_the_papers_rows():
    assert photometry.paper_saturation_percent() == pytest.approx(
        np.array([[55.3, 0.0], [23.2, 1.7], [0.1, 12.1]])
    )


def test_the_bench_has_the_committed_strengths():
    result = json.loads((DATA / "photometry.json").read_text())["values"]
    used = laboratory.GAIN, laboratory.EARTHSHINE, laboratory.SUN
    assert used == pytest.approx([result[k] for k in ("gain", "earthshine", "sun")], rel=5e-4)


def test_more_light_makes_less_black_and_more_white():
    images, regions = photometry.lamp_images(Camera.davis346(), Port.lm_map(), ["realistic-1"], 1)
    assert len(images) == len(regions) == 1
    dim, bright = (
        photometry.mean_saturation_percent(images, regions, g, 100.0, 1000.0) for g in (0.03, 0.06)
    )
    assert np.all(bright[:, 0] <= dim[:, 0]) and np.all(bright[:, 1] >= dim[:, 1])
    assert np.any(bright != dim)
