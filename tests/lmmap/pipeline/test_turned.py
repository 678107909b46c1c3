"""The second look: at the image and its half turn, and only where a ring is seen without a sure pose."""

from dataclasses import replace

import numpy as np
import pytest
from strategies import CAMERA, PORT, pose

from lmmap.geometry.port import ideal_masks
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.network import FilterNet, MaskNetwork, TurnedToo
from lmmap.settings import OURS, PerCamera
from lmmap.types import Status

T0 = pose((180, 120), 0.6, 0.5, 0.8)
RING, MARKERS = ideal_masks(T0, PORT, CAMERA)
IMAGE = np.zeros((CAMERA.height_px, CAMERA.width_px), np.uint32)
IMAGE[0, 0] = 1  # a turned image has it at the other end
SURE = replace(
    OURS, min_confidence=PerCamera(0.0, 0.0), sure_confidence=0.0
)  # the image is blank: only the masks speak


class Network:
    """Gives one mask of the image as it is, and another one, turned, of the turned image."""

    def __init__(self, mask, of_turned):
        self.mask, self.of_turned, self.calls = mask, of_turned, 0

    def __call__(self, image):
        self.calls += 1
        return self.mask if image[0, 0] else self.of_turned[::-1, ::-1]


def estimate(ring, reflectors, settings):
    return Estimator(CAMERA, PORT, "event", (ring, reflectors), settings)(IMAGE)


def test_a_turned_image_gives_the_turned_mask():
    network = TurnedToo(MaskNetwork(FilterNet(1), "event", "float32"))
    image = np.random.default_rng(0).integers(0, 6, (45, 61))
    np.testing.assert_array_equal(network(image[::-1, ::-1]), network(image)[::-1, ::-1])


def test_what_a_mask_depends_on_is_alike_to_both_sides_and_holds_the_network_s():
    network = MaskNetwork(FilterNet(1), "event", "float32")
    first, last = TurnedToo(network).inputs_of(0, 7)
    assert (first, last) == (-last + 7, last) and first <= network.inputs_of(0, 7)[0] and last == 22
    assert not hasattr(TurnedToo(lambda image: image), "inputs_of")


@pytest.mark.parametrize("turned_look, status", [(False, Status.NO_MARKERS), (True, Status.OK)])
def test_markers_that_only_the_turned_image_shows_are_found_by_the_second_look(turned_look, status):
    e = estimate(Network(RING, RING), Network(0 * MARKERS, MARKERS), replace(SURE, turned_look=turned_look))
    assert e.status == status
    if turned_look:
        np.testing.assert_allclose(e.T_cam_port.position_m, T0.position_m, atol=2e-3)


def test_an_image_with_a_pose_or_without_a_ring_is_looked_at_once():
    for ring, status in ((RING, Status.OK), (0 * RING, Status.NO_RING)):
        network = Network(ring, ring)
        e = estimate(network, Network(MARKERS, MARKERS), replace(SURE, turned_look=True))
        assert (e.status, network.calls) == (status, 1)


def test_a_second_look_that_shows_no_more_leaves_the_first_answer():
    ring, reflectors = Network(RING, RING), Network(MARKERS, MARKERS)
    never = replace(OURS, min_confidence=PerCamera(1.0, 1.0), look_independence=0.0)
    once, twice = (estimate(ring, reflectors, replace(never, turned_look=look)) for look in (False, True))
    assert once.status == twice.status == Status.UNSURE and twice.T_cam_port is None
    assert (once.confidence, ring.calls) == (twice.confidence, 1 + 1 + 2)
