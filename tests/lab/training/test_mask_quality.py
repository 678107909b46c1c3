"""Measures of masks: limits, hand-worked cases, and the shipped filters on the committed recording."""

import dataclasses

import numpy as np
import pytest
import strategies
from hypothesis import given

from lmmap.geometry.port import ideal_masks
from lmmap.pipeline.network import CHANNELS
from lmmap.pipeline.weights import FILTERS
from lmmap.recordings.formats import open_recording
from lmmap_lab.provenance import DATA
from lmmap_lab.training.mask_quality import (
    filter_quality,
    iou,
    medians,
    middle_lines_px,
    missed_share,
    skeleton_distance,
)


def band(row, width=3, shape=(40, 60)):
    mask = np.zeros(shape, bool)
    mask[row - width // 2 : row + width // 2 + 1, 5:55] = True
    return mask


def test_overlap_by_hand_and_its_limits():
    empty = np.zeros((40, 60), bool)
    assert iou(band(20), band(20)) == 1
    assert iou(band(20), band(21)) == pytest.approx(2 / 4)
    assert iou(band(20), empty) == 0
    assert iou(empty, empty) == 1


@pytest.mark.parametrize("shift", [0, 1, 2.5, 4])
def test_skeleton_distance_is_the_shift_and_ignores_the_stroke(shift):
    line = np.column_stack([np.arange(0, 60, 0.25), np.full(240, 20 - shift)])
    for width in (3, 5):
        away_px, stray = skeleton_distance(band(20, width), line)
        assert away_px == pytest.approx(shift, abs=0.01)
        assert stray == pytest.approx(float(shift > 2), abs=0.1)  # a skeleton's ends may fork


@given(strategies.visible_poses(max_tilt_deg=55))
def test_true_masks_have_their_skeletons_on_the_middle_lines(T):
    masks = ideal_masks(T, strategies.PORT, strategies.CAMERA) > 0.5
    ring, markers = middle_lines_px(T, strategies.PORT, strategies.CAMERA)
    assert skeleton_distance(masks[0], ring)[0] < 0.6  # pixels, and a circle's centre-line is not its middle
    u, v = np.round(markers).astype(int).T
    assert ideal_masks(T, strategies.PORT, strategies.CAMERA)[1, v, u].mean() > 0.8


def test_missed_share_of_half_a_band():
    half = band(20)
    half[:, 30:] = False
    assert missed_share(half, band(20)) == pytest.approx(0.5, abs=0.06)
    assert missed_share(band(20), band(20)) == 0
    assert missed_share(np.zeros_like(half), band(20)) == 1


def test_what_lies_off_the_line_is_astray():
    line = np.column_stack([np.arange(0, 60, 0.25), np.full(240, 20)])
    _, stray = skeleton_distance(band(20) | band(30), line)
    assert stray == pytest.approx(0.5, abs=0.01)
    assert skeleton_distance(band(20), line)[1] == 0


def test_empty_masks_have_no_skeleton_distance():
    assert np.isnan(skeleton_distance(np.zeros((40, 60), bool), np.zeros((1, 2)))).all()
    assert np.isnan(missed_share(band(20), np.zeros((40, 60), bool)))


def test_filters_on_the_committed_recording():
    recording = open_recording(DATA / "mini" / "test-low.aedat4")
    table = filter_quality(recording, most=3)
    assert len(table) == 3 * len(FILTERS) * len(CHANNELS)
    assert table.iou.between(0, 1).all()
    summary = medians(table).set_index(["filter", "modality"])
    assert summary.loc[("ring", "rgb"), "iou"] > 0.5
    assert summary.loc[("ring", "rgb"), "skeleton_px"] < 1
    assert (summary.images == 3).all()
    with pytest.raises(ValueError, match="truth"):
        filter_quality(dataclasses.replace(recording, truth=None))
