"""The whole path on a drawn recording, with the shipped weights."""

from dataclasses import replace
from itertools import pairwise

import drawn
import numpy as np
import pytest
from strategies import off

from lmmap.estimation.estimates import estimate, estimate_image, estimate_images
from lmmap.estimation.images import TimedImage, images, timed_images
from lmmap.evaluation.pose_errors import true_poses
from lmmap.geometry.conics import circle_ellipse
from lmmap.geometry.port import ideal_masks
from lmmap.geometry.projection import project
from lmmap.geometry.rotations import rotation_z
from lmmap.pipeline import circle
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.looks import look_again
from lmmap.pipeline.masks import markers_box_px, reflector_mask
from lmmap.pipeline.network import MaskNetwork
from lmmap.pipeline.setup import Setup
from lmmap.settings import OURS, PAPER, PerCamera
from lmmap.types import Camera, Estimate, InputError, Port, Pose, Status


@pytest.fixture(scope="module")
def recording():
    return drawn.recording()


@pytest.fixture(scope="module", params=["rgb", "event"])
def answers(request, recording):
    estimator = Estimator(modality=request.param)
    return estimator, list(estimate(recording, estimator))


def test_every_image_is_answered(recording, answers):
    estimator, estimates = answers
    expected = {"rgb": len(recording.frames), "event": len(recording.events) // PAPER.events_per_window}
    assert len(estimates) == expected[estimator.modality] > 10
    assert np.all(np.diff([e.t_us for e in estimates]) > 0)


def test_poses_are_near_the_truth_and_the_printed_formula_is_further(recording, answers):
    _, estimates = answers
    for e, T in zip(*true_poses(recording, estimates), strict=True):
        assert e.status == Status.OK and e.rival is not None
        normal_deg, position_mm = off(e.T_cam_port, T)
        assert normal_deg < 1 and position_mm < 3
        assert normal_deg < off(e.printed, T)[0]


def test_an_answer_does_not_depend_on_those_before(recording, answers):
    estimator, estimates = answers
    t_us, image = list(images(recording, estimator.modality))[7]
    again = estimator(image, t_us)
    assert again.status == estimates[7].status
    if again.T_cam_port is not None:
        # equal bits; but in float32 sums go by where arrays lie in memory
        atol = 1e-6 if estimator.ring_network.precision == "float32" else 0
        assert np.allclose(again.T_cam_port.rotation, estimates[7].T_cam_port.rotation, rtol=0, atol=atol)


def test_reflectors_on_the_crop_equal_the_full_frame_there(recording):
    estimator = Estimator(modality="rgb")
    pose = recording.truth.poses[:1]
    ellipse = circle_ellipse(pose[0], estimator.port.ring_radius_m, recording.camera)
    circles = circle.candidates(ellipse, recording.camera, estimator.port.ring_radius_m)
    of = circles, estimator.port, recording.camera
    crop = reflector_mask(estimator.reflector_network, recording.frames[0], *of)
    full = estimator.reflector_network(recording.frames[0])
    low, high = (np.round(x).astype(int) for x in markers_box_px(pose, estimator.port, recording.camera))
    inside = np.s_[low[1] : high[1], low[0] : high[0]]
    assert isinstance(estimator.reflector_network, MaskNetwork)
    assert crop[inside].max() > 0.5 and np.abs(crop[inside] - full[inside]).max() < 1e-5


def test_the_markers_box_holds_them_at_any_yaw_and_no_more_than_it_must(recording):
    port, camera, pose = Port.lm_map(), recording.camera, recording.truth.poses[0]
    turned = pose.rotation @ rotation_z(np.deg2rad(np.arange(0, 120, 0.5)))
    corners = project(
        Pose(turned, np.tile(pose.position_m, (240, 1)))[:, None, None] @ port.marker_corners_m(), camera
    )
    low, high = markers_box_px(pose[None], port, camera)
    margin = np.concatenate([corners.min((0, 1, 2)) - low, high - corners.max((0, 1, 2))])
    assert (
        margin.min() >= OURS.marker_border_px
        and margin.max() < OURS.marker_border_px + 0.2 * (high - low).max()
    )


def test_images_are_answered_in_order_and_an_error_comes_after_those_before_it():
    def shots():
        yield from (TimedImage(t, np.full((2, 2), t)) for t in range(7))
        raise InputError("the file ends here")

    seen = []
    with pytest.raises(InputError, match="ends here"):
        for image, answer in estimate_images(shots(), lambda image, t_us: Estimate(t_us, Status.NO_RING)):
            seen.append((int(image[0, 0]), answer.t_us))
    assert seen == [(t, t) for t in range(7)]
    assert list(estimate_images([], None)) == []


class Toy:
    """Sees in an image of one value: 0 nothing, 1 a ring without markers, 2 the port, 3 the port in doubt."""

    settings = replace(OURS, min_confidence=PerCamera(0.85, 0.85), look_independence=1.0)
    further = ()

    def __init__(self):
        self.asked = []

    def __call__(self, image, t_us, wider=None):
        self.asked.append(t_us)
        statuses = (Status.NO_RING, Status.NO_MARKERS, Status.OK, Status.UNSURE)
        kind, T = int(image[0, 0]), Pose(np.eye(3), np.ones(3))
        seen, doubtful = (T if kind == 2 else None), (T if kind == 3 else None)
        confidence = {2: 0.97, 3: 0.7}.get(kind, 0.0)
        answer = Estimate(t_us, statuses[kind], seen, doubtful=doubtful, confidence=confidence)
        return look_again(self, answer, image, t_us, None, wider)

    @property
    def setup(self):
        return Setup(Port.lm_map(), Camera.davis346(), "event", self.settings)


def shot_of(first, wider):
    return TimedImage(9, np.full((2, 2), first), (wider is not None and (5, np.full((2, 2), wider))) or None)


@pytest.mark.parametrize(
    "first, wider, taken, status",
    [(0, 2, 5, "ok"), (1, 2, 5, "ok"), (0, 0, 9, "no_ring"), (1, 0, 9, "no_markers"), (0, 1, 9, "no_ring"),
     (2, 2, 9, "ok"), (0, None, 9, "no_ring"), (3, 2, 5, "ok"), (3, 0, 9, "unsure"), (3, 3, 9, "ok"),
     (0, 3, 5, "unsure")],
)  # fmt: skip
def test_a_wider_image_is_looked_at_only_where_the_first_shows_no_sure_pose(first, wider, taken, status):
    """Two doubtful looks that agree are a pose: 1 - 0.3 * 0.3 is over the limit."""
    estimator, shot = Toy(), shot_of(first, wider)
    image, answer = estimate_image(estimator, shot)
    assert (answer.t_us, answer.status) == (taken, status) and answer.t_us in shot.times_us
    assert image[0, 0] == (wider if taken == 5 else first)
    assert estimator.asked == ([9] if first == 2 or wider is None else [9, 5])


@pytest.mark.parametrize("rate_hz", [None, 5.0, 10.0])
def test_a_wider_shot_holds_the_same_events_and_as_many_before(recording, rate_hz):
    shots = list(timed_images(recording, "event", rate_hz=rate_hz))
    assert [(s.t_us, s.image.sum()) for s in shots] == [
        (t_us, image.sum()) for t_us, image in images(recording, "event", rate_hz=rate_hz)
    ]
    wide = [(a, b) for a, b in pairwise(shots) if b.wider]
    assert len(wide) > len(shots) / 3
    for a, b in wide:
        assert a.t_us < b.wider[0] <= b.t_us
        assert b.wider[1].sum() == OURS.second_look_factor * b.image.sum() and np.all(b.wider[1] >= b.image)
        if rate_hz is None:
            assert np.all(b.wider[1] <= a.image + b.image)
    assert all(s.wider is None for s in timed_images(recording, "rgb"))


def test_dark_and_noise_have_no_ring(rng):
    for modality, dark in (
        ("rgb", np.zeros((260, 346, 3), np.uint8)),
        ("event", np.zeros((260, 346), np.uint16)),
    ):
        estimator = Estimator(modality=modality)
        assert estimator(dark).status == Status.NO_RING
        noise = rng.integers(0, 3, dark.shape).astype(dark.dtype)
        assert estimator(noise).status != Status.OK


def test_rate_takes_the_last_events_before_each_tick(recording):
    at = list(images(recording, "event", rate_hz=10.0))
    assert np.diff([t for t, _ in at]) == pytest.approx(1e5, rel=0.5)
    assert all(image.sum() == PAPER.events_per_window for _, image in at)
    frames = [t for t, _ in images(recording, "rgb", rate_hz=10.0)]
    assert np.diff(frames) == pytest.approx(1e5, rel=0.1)


def test_misuse():
    with pytest.raises(ValueError, match="modality"):
        Estimator(modality="lidar")
    with pytest.raises(ValueError, match="image"):
        Estimator(Camera(640, 480, 500, 500, 320, 240))(np.zeros((260, 346, 3), np.uint8))
    with pytest.raises(InputError, match="no readable weights"):
        Estimator(weights="nowhere")


def test_the_networks_can_be_any_two_functions(recording):
    T = recording.truth.poses[0]
    ring, markers = ideal_masks(T, Port.lm_map(), recording.camera)
    estimated = Estimator(recording.camera, weights=(lambda image: ring, lambda image: markers))(
        recording.frames[0]
    )
    assert estimated.status == Status.OK
    normal_deg, position_mm = off(estimated.T_cam_port, T)
    assert position_mm < 2 and normal_deg < 1
