"""Promises of the tracker, on ideal masks: what it answers and claims, how it loses the port and finds it."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from strategies import PORT, edge_events, moved, pose

from lmmap.geometry.port import ideal_masks
from lmmap.geometry.rotations import rotation_between_rad
from lmmap.pipeline.estimator import Estimator
from lmmap.settings import OURS, PerCamera
from lmmap.tracking.tracker import Tracker
from lmmap.types import EVENT, Camera, Pose, Status

CAMERA = Camera(160, 120, 324.0, 324.0, 79.5, 59.5)
SETTINGS = replace(OURS, min_confidence=PerCamera(0.0, 0.0))  # the images are blank: only the masks speak
STEP_US = 50_000


class Scene:
    """Poses (None: no port) by number of the image; images tell their number and the place of each pixel."""

    def __init__(self, poses):
        self.poses, self.pixels = poses, []
        blank = np.zeros((2, CAMERA.height_px, CAMERA.width_px), np.float32)
        self.masks = [blank if T is None else ideal_masks(T, PORT, CAMERA) for T in poses]

    def image(self, k: int) -> np.ndarray:
        v, u = np.mgrid[: CAMERA.height_px, : CAMERA.width_px]
        return np.stack([np.full_like(u, k), u, v], -1).astype(np.uint8)

    def histogram(self, k: int) -> np.ndarray:
        return self.image(k).astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)

    def estimator(self, modality="rgb") -> Estimator:
        return Estimator(CAMERA, PORT, modality, (_Network(self, 0), _Network(self, 1)), SETTINGS)


class _Network:
    """Gives the ideal mask of an image or of its crop; what it gives is local, so crops are exact."""

    stride_px, inputs_of = 8, staticmethod(lambda first, last: (first, last))

    def __init__(self, scene: Scene, kind: int):
        self.scene, self.kind = scene, kind

    def __call__(self, image):
        height, width = image.shape[:2]
        if self.kind == 0:
            self.scene.pixels.append(height * width)
        code = int(image[0, 0]) if image.ndim == 2 else int(image[0, 0] @ [1 << 16, 1 << 8, 1])
        k, left, top = code >> 16, code >> 8 & 255, code & 255
        return self.scene.masks[k][self.kind][top : top + height, left : left + width]


def approach(count: int, start_m=1.05) -> list[Pose]:
    """A port that comes nearer while it turns."""
    return [pose((78 + 0.4 * k, 60), start_m - 0.004 * k, 0.4, 0.5, 0.02 * k, CAMERA) for k in range(count)]


def right(e, T) -> bool:
    if e.status != Status.OK:
        return False
    near = np.linalg.norm(e.T_cam_port.position_m - T.position_m) < OURS.right_position_m
    turned_rad = rotation_between_rad(e.T_cam_port.rotation, T.rotation, PORT.yaw_period_rad)
    return bool(near and turned_rad < OURS.right_normal_rad)


def track(scene: Scene, numbers=None) -> list:
    tracker = Tracker(scene.estimator())
    return [tracker(scene.image(k), STEP_US * k) for k in numbers or range(len(scene.poses))]


def test_a_port_is_followed_in_crops():
    scene = Scene(approach(12))
    assert all(right(e, T) for e, T in zip(track(scene), scene.poses, strict=True))
    whole = CAMERA.width_px * CAMERA.height_px
    assert scene.pixels[0] == whole and max(scene.pixels[3:]) < 0.6 * whole


def test_what_was_predicted_is_told():
    scene = Scene(approach(4))
    first, *others = track(scene)
    assert first.predicted is None
    for e, T in zip(others, scene.poses[1:], strict=True):
        assert np.linalg.norm(e.predicted.position_m - T.position_m) < 0.02


def test_nothing_is_ok_that_no_image_shows():
    scene = Scene([*approach(6), *[None] * 8])
    answers = track(scene)
    assert [e.status for e in answers[:6]] == [Status.OK] * 6
    assert answers[6].status == Status.PREDICTED and answers[6].T_cam_port is not None
    assert Status.OK not in [e.status for e in answers[6:]]
    assert (answers[-1].status, answers[-1].T_cam_port) == (Status.NO_RING, None)


def test_a_pose_that_its_image_leaves_doubtful_is_a_prediction_also_where_the_track_expects_it():
    """Images in a row may have one and the same fault, and a track that follows them confirms it."""
    scene = Scene(approach(6))
    tracker, estimator = Tracker(scene.estimator()), scene.estimator()
    for k in range(4):
        assert tracker(scene.image(k), STEP_US * k).status == Status.OK
    estimator.settings = replace(estimator.settings, min_confidence=PerCamera(1.0, 1.0))
    tracker.estimators = {"rgb": estimator}
    e = tracker(scene.image(4), STEP_US * 4)
    assert (e.status, e.measured) == (Status.PREDICTED, None)
    assert right(replace(e, status=Status.OK, T_cam_port=e.doubtful), scene.poses[4])


class _Doubting(Estimator):
    """Reports its poses with a confidence that is enough for an image, but not sure."""

    def __call__(self, *arguments):
        e = super().__call__(*arguments)
        return e if e.found is None else e.judged(OURS.sure_confidence - 0.1, 0.7)


def doubting(scene: Scene) -> Tracker:
    estimator = scene.estimator()
    estimator.__class__ = _Doubting
    return Tracker(estimator)


def test_a_track_that_one_doubtful_image_began_is_unsure_until_a_second_one_shows_it():
    scene = Scene(approach(4))
    tracker = doubting(scene)
    first, *others = (tracker(scene.image(k), STEP_US * k) for k in range(4))
    assert (first.status, first.T_cam_port) == (Status.UNSURE, None)
    assert right(replace(first, status=Status.OK, T_cam_port=first.doubtful), scene.poses[0])
    assert all(right(e, T) for e, T in zip(others, scene.poses[1:], strict=True))


def test_a_track_that_its_images_no_longer_support_predicts_nothing():
    """After the second image that does not show the port; with a track of one image, after the first."""
    shown = Scene([*approach(5), *[None] * 2])
    assert [e.status for e in track(shown)[5:]] == [Status.PREDICTED, Status.UNSURE]
    lone = Scene([*approach(1), None])
    tracker = Tracker(lone.estimator())
    answers = [tracker(lone.image(k), STEP_US * k) for k in range(2)]
    assert [e.status for e in answers] == [Status.OK, Status.UNSURE]
    assert tracker.at(STEP_US + 1000).status == Status.UNSURE and answers[1].doubtful is not None


@pytest.mark.parametrize("hidden", [1, 2, 6])
def test_after_a_loss_the_port_is_found_within_two_images_wherever_it_is(hidden):
    elsewhere = [pose((95, 50), 0.9, 0.5, 2.0, 0.7, CAMERA)] * 4
    scene = Scene([*approach(5), *[None] * hidden, *elsewhere])
    answers = track(scene)[5 + hidden :]
    assert any(right(e, elsewhere[0]) for e in answers[:2]) and all(
        right(e, elsewhere[0]) for e in answers[2:]
    )


def test_a_pose_that_contradicts_the_track_is_not_believed_once_but_twice():
    jump = pose((60, 70), 0.9, 0.5, 2.0, 0.7, CAMERA)
    once, twice = (track(Scene([*approach(5), *[jump] * n, *approach(9)[5 + n :]])) for n in (1, 2))
    assert once[5].status == Status.PREDICTED and right(once[6], approach(9)[6])
    assert right(twice[6], jump)


def test_a_gap_ends_the_track_and_not_the_tracker():
    scene = Scene(approach(8))
    numbers = [0, 1, 2, 7]
    tracker = Tracker(scene.estimator())
    times_us = [0, STEP_US, 2 * STEP_US, 3_600_000_000]
    answers = [tracker(scene.image(k), t) for k, t in zip(numbers, times_us, strict=True)]
    assert all(right(e, scene.poses[k]) for e, k in zip(answers, numbers, strict=True))
    alone = scene.estimator()(scene.image(7))
    np.testing.assert_allclose(answers[-1].T_cam_port.position_m, alone.T_cam_port.position_m, atol=1e-12)


@pytest.mark.parametrize("t_us", [STEP_US, 12_345])
def test_times_that_repeat_or_go_back_are_named(t_us):
    scene = Scene(approach(3))
    tracker = Tracker(scene.estimator())
    tracker(scene.image(0), STEP_US)
    with pytest.raises(ValueError, match=f"later than {STEP_US} us, got {t_us} us"):
        tracker(scene.image(1), t_us)
    with pytest.raises(ValueError, match=f"expected {STEP_US} or later, got 7"):
        tracker.at(7)


@pytest.mark.parametrize("image, t_us, wider", [
    (np.zeros((2, 2, 3), np.uint8), 4 * STEP_US, None),
    (None, 10**12, None),
    (None, float("nan"), None),
    (np.full((CAMERA.height_px, CAMERA.width_px), np.inf), 4 * STEP_US, None),
    (np.full((CAMERA.height_px, CAMERA.width_px), -1.0), 4 * STEP_US, None),
    (0, 4 * STEP_US, (4 * STEP_US, np.zeros((2, 2), int))),
    (0, 4 * STEP_US, (5 * STEP_US, 0)),
    (0, 4 * STEP_US, (float("nan"), 0)),
    (0, 4 * STEP_US, 7),
])  # fmt: skip
def test_what_is_refused_changes_nothing(image, t_us, wider):
    """An image that is refused, for itself or for its time, and the right one after it."""
    scene, answers = Scene(approach(6)), []
    for refused in (False, True):
        tracker = Tracker(scene.estimator("event"))
        for k in range(6):
            if refused and k == 4:
                with pytest.raises(ValueError, match=r"^(image|t_us|wider): "):
                    bad = scene.histogram(4) if isinstance(image, int) else image
                    shot = wider and (
                        wider
                        if wider == 7
                        else (wider[0], scene.histogram(4) if isinstance(wider[1], int) else wider[1])
                    )
                    tracker(bad, t_us, shot)
            answers.append(repr(tracker(scene.histogram(k), STEP_US * k)))
    assert answers[:6] == answers[6:]


@pytest.mark.parametrize("t_us", [float("nan"), float("inf"), None, "0"])
def test_no_pose_is_told_of_a_time_that_is_none(t_us):
    scene = Scene(approach(2))
    for seen in (0, 2):
        tracker = Tracker(scene.estimator())
        for k in range(seen):
            tracker(scene.image(k), STEP_US * k)
        with pytest.raises(ValueError, match=r"t_us: expected .*, got "):
            tracker.at(t_us)


def test_between_images_the_pose_is_a_prediction_that_gets_looser():
    scene = Scene(approach(6))
    tracker = Tracker(scene.estimator())
    answers = [tracker(scene.image(k), STEP_US * k) for k in range(6)]
    last_us = 5 * STEP_US
    assert tracker.at(last_us).status == Status.OK
    np.testing.assert_array_equal(tracker.at(last_us).covariance, answers[-1].covariance)
    later = [tracker.at(last_us + dt) for dt in (5_000, 40_000)]
    assert {e.status for e in later} == {Status.PREDICTED}
    volumes = [np.linalg.slogdet(e.covariance)[1] for e in (answers[-1], *later)]
    assert np.all(np.diff(volumes) > 0)
    assert tracker.at(last_us + 10_000_000).T_cam_port is None


def test_a_whole_image_is_looked_at_now_and_then():
    scene = Scene([approach(1)[0]] * 11)
    estimator = scene.estimator()
    estimator.settings = replace(SETTINGS, full_frame_every=4)
    tracker = Tracker(estimator)
    for k in range(11):
        tracker(scene.image(k), STEP_US * k)
    full = np.flatnonzero(np.array(scene.pixels) == CAMERA.width_px * CAMERA.height_px)
    np.testing.assert_array_equal(full, [0, 4, 8])


def test_each_camera_has_its_own_look_at_the_whole_image_now_and_then():
    scene, every = Scene([approach(1)[0]] * 11), 4
    both = [scene.estimator("rgb"), scene.estimator("event")]
    for estimator in both:
        estimator.settings = replace(SETTINGS, full_frame_every=every)
    tracker, full = Tracker(*both), {"rgb": [], "event": []}
    for k in range(11):
        for modality, image in (("rgb", scene.image(k)), ("event", scene.histogram(k))):
            scene.pixels.clear()
            tracker(image, STEP_US * k)
            full[modality] += [k] * (CAMERA.width_px * CAMERA.height_px in scene.pixels)
    assert full == {"rgb": [0, 4, 8], "event": [3, 7]}  # the first frame already says where the port is


def test_eight_threads_answer_as_one():
    scene = Scene(approach(8))
    estimator = scene.estimator()

    def run(_):
        tracker = Tracker(estimator)
        return [tracker(scene.image(k), STEP_US * k).T_cam_port for k in range(8)]

    with ThreadPoolExecutor(8) as pool:
        first, *others = pool.map(run, range(8))
    for other in others:
        for a, b in zip(first, other, strict=True):
            np.testing.assert_array_equal(a.position_m, b.position_m)
            np.testing.assert_array_equal(a.rotation, b.rotation)


def test_both_cameras_make_one_track():
    scene = Scene(approach(10))
    tracker = Tracker(scene.estimator("rgb"), scene.estimator("event"))
    alone = Tracker(scene.estimator("rgb"))
    for k in range(10):
        frame, both = scene.image(k), tracker(scene.image(k), STEP_US * k)
        frames_only = alone(frame, STEP_US * k)
        events = tracker(scene.histogram(k), STEP_US * k)
        assert right(both, scene.poses[k]) and right(events, scene.poses[k])
    assert np.linalg.slogdet(events.covariance)[1] < np.linalg.slogdet(frames_only.covariance)[1]


def test_misuse_is_named():
    scene = Scene(approach(1))
    rgb = scene.estimator()
    with pytest.raises(ValueError, match="estimators: expected one for each kind of image"):
        Tracker(rgb, rgb)
    with pytest.raises(ValueError, match="estimators: expected the same camera"):
        Tracker(rgb, Estimator(modality="event", weights=(np.sqrt, np.sqrt)))
    with pytest.raises(ValueError, match=r"image: expected one of \['rgb'\], got shape \(120, 160\)"):
        Tracker(rgb)(scene.histogram(0), 0)


START, SPEED = pose((70, 60), 0.75, 0.4, 0.5, 0.1, CAMERA), np.array([0.1, 0.03, -0.02, 0.0, 0.1, 0.2])


def pushed(t_us) -> Pose:
    """A port that moves steadily, and from 250 ms on half as fast again."""
    return moved(START, SPEED * 1e-6 * (t_us + 0.5 * max(t_us - 250_000, 0)))


PUSHED = Scene([pushed(STEP_US * k) for k in range(8)])


def followed() -> Tracker:
    """A tracker that has seen the pushed port each 50 ms until then."""
    tracker = Tracker(PUSHED.estimator(), events=True)
    for k in range(6):
        tracker(PUSHED.image(k), STEP_US * k)
    return tracker


def of_the_push(first_us, last_us) -> np.ndarray:
    """Events of the pushed port's edges, as late as they are thought to be."""
    rng, late_us = np.random.default_rng(2), OURS.between.late_us
    return np.concatenate([edge_events(rng, t_us, pushed(t_us - late_us), 1.5 * SPEED, 200, 100, CAMERA)
                           for t_us in range(first_us, last_us, 2000)])  # fmt: skip


def test_events_tell_of_a_push_that_no_image_has_seen():
    tracker, without = followed(), followed()
    assert tracker.add_events(of_the_push(252_000, 330_000)) > 15
    now, predicted = tracker.at(330_000), without.at(330_000)
    truth_m = pushed(330_000).position_m
    behind_m, off_m = (np.linalg.norm(e.T_cam_port.position_m - truth_m) for e in (predicted, now))
    assert behind_m > 0.003 and off_m < 0.5 * behind_m
    assert now.status == predicted.status == Status.PREDICTED
    d = now.T_cam_port.position_m - truth_m
    assert d @ np.linalg.solve(now.covariance[:3, :3], d) < 11.34  # its 99 % region holds the truth


def test_events_at_no_edge_leave_the_prediction():
    tracker, without = followed(), followed()
    corner = np.zeros(400, EVENT)
    corner["t_us"] = 251_000 + 100 * np.arange(400)
    assert tracker.add_events(corner) == tracker.add_events(corner[:0]) == 0
    a, b = tracker.at(300_000), without.at(300_000)
    np.testing.assert_array_equal(a.T_cam_port.position_m, b.T_cam_port.position_m)
    np.testing.assert_array_equal(a.covariance, b.covariance)


def test_an_image_that_is_older_than_the_newest_events_still_counts():
    """The port is where events say, and the image of 50 ms ago agrees."""
    tracker = followed()
    tracker.add_events(of_the_push(252_000, 350_000))
    before = tracker.at(350_000)
    assert right(tracker(PUSHED.image(6), 6 * STEP_US), PUSHED.poses[6])
    after = tracker.at(350_000)
    assert np.linalg.slogdet(after.covariance)[1] < np.linalg.slogdet(before.covariance)[1]
    assert np.linalg.norm(after.T_cam_port.position_m - pushed(350_000).position_m) < 0.003


def test_events_hold_no_track_that_images_have_lost():
    tracker = followed()
    lost_us = 250_000 + int(1e6 * SETTINGS.between.motion.lost_s) - SETTINGS.between.late_us
    tracker.add_events(of_the_push(252_000, lost_us + 100_000))
    assert tracker.at(lost_us).T_cam_port is not None
    assert tracker.at(lost_us + 100_000).T_cam_port is None


def test_events_that_go_back_are_named():
    tracker = followed()
    tracker.add_events(of_the_push(252_000, 254_000)[:5])
    with pytest.raises(ValueError, match="got 251000 us after 252"):
        tracker.add_events(of_the_push(251_000, 253_000))
    with pytest.raises(ValueError, match="events=True"):
        Tracker(Scene(approach(1)).estimator()).add_events(np.zeros(0, EVENT))
