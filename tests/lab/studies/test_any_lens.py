"""A picture of an unknown lens is looked at through several, and its ring comes out where it is."""

import cv2
import drawn
import numpy as np
import pytest

from lmmap.geometry.conics import circle_ellipse
from lmmap.pipeline.weights import load_networks
from lmmap.types import Camera, Port, Pose
from lmmap_lab.studies.any_lens import Look, best_look, looks, marker_scores, markers_px

PORT = Port.lm_map()
FACING = np.diag([1.0, -1.0, -1.0])


@pytest.fixture(scope="module")
def networks():
    return load_networks("robust", "rgb", "float32")


@pytest.mark.parametrize("zoom", [0.75, 1.0, 2.0])
def test_the_ring_is_found_however_large_the_picture_is(zoom, networks):
    recording = drawn.recording()
    frame = recording.frames[0]
    truth = recording.truth.at(recording.frames_t_us[:1])[0]
    true = circle_ellipse(truth, PORT.ring_radius_m, recording.camera)
    picture = cv2.resize(frame, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_AREA)
    look = best_look([*looks(picture, "rgb", networks, widths_px=(173, 346))])
    ring = look.ellipse_in(picture.shape[1::-1])
    np.testing.assert_allclose((ring.centre_px + 0.5) / zoom - 0.5, true.centre_px, atol=0.7)
    np.testing.assert_allclose(ring.semi_axes_px / zoom, true.semi_axes_px, rtol=0.03)


def test_a_look_at_nothing_finds_nothing_and_never_wins(networks):
    dark = [*looks(np.zeros((130, 173, 3), np.uint8), "rgb", networks)]
    assert len(dark) == 2  # no wider than the picture allows
    assert best_look(dark).ellipse_in((173, 130)) is None
    better = Look(*dark[0][:-1], contrast=0.1)
    assert best_look([*dark, better]) is better


def test_markers_are_scored_one_by_one():
    camera = Camera.davis346()
    corners = markers_px(Pose(FACING, [0, 0, 0.4]), PORT, camera)
    mask = np.zeros(camera.size_px[::-1], np.float32)
    (u, v) = corners[1].mean(0)
    mask[round(v) - 12 : round(v) + 13, round(u) - 12 : round(u) + 13] = 1
    scores = marker_scores(mask, corners)
    assert scores[1] > 0.5 and scores[0] == scores[2] == 0
    np.testing.assert_allclose(marker_scores(np.ones_like(mask), corners), 1)
