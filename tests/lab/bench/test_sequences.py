"""Sequences: reproducible from their names, smooth, labelled as rendered."""

import cv2
import numpy as np
import pytest

from lmmap.geometry.port import circle_points_m
from lmmap.geometry.projection import project
from lmmap.types import Camera, InputError, Port
from lmmap_lab.bench import labels, laboratory, sequences


@pytest.fixture(scope="module")
def short():
    return sequences.simulate("test-medium", 0.25)


def test_same_name_same_bytes(short):
    again = sequences.simulate("test-medium", 0.25)
    assert np.array_equal(again.events, short.events)
    assert np.array_equal(again.frames, short.frames)


class Stopped(Exception):
    """Stands for Ctrl-C."""


def test_an_interrupted_simulation_goes_on_to_the_same_bytes(tmp_path, monkeypatch, short):
    monkeypatch.setattr(sequences, "PART_S", 0.06)

    def stop(done_s):
        if done_s > 0.17:
            raise Stopped

    with pytest.raises(Stopped):
        sequences.simulate("test-medium", 0.25, stop, parts=tmp_path / "parts")
    kept = sorted((tmp_path / "parts").glob("*.h5"))
    assert len(kept) == 2
    kept[1].write_bytes(kept[1].read_bytes()[:-100])  # a part cut short is made anew
    begun = []
    again = sequences.simulate("test-medium", 0.25, begun.append, parts=tmp_path / "parts")
    assert 0.06 < begun[0] < 0.17
    assert np.array_equal(again.events, short.events)
    assert np.array_equal(again.frames, short.frames)
    assert np.array_equal(again.frames_t_us, short.frames_t_us)


def test_parts_of_something_else_are_not_taken(tmp_path, monkeypatch, short):
    monkeypatch.setattr(sequences, "PART_S", 0.06)
    sequences.simulate("test-low", 0.15, parts=tmp_path / "parts")
    again = sequences.simulate("test-medium", 0.25, parts=tmp_path / "parts")
    assert np.array_equal(again.events, short.events)


def test_distorted_and_other_cameras_record():
    camera = Camera(96, 64, 90.0, 90.0, 47.5, 31.5, distortion=(-0.2, 0.05, 0.001, 0.0))
    recording = sequences.simulate("realistic-2", 0.15, camera=camera)
    assert recording.frames.shape[1:] == (64, 96, 3)
    assert recording.events["x"].max() < 96 and recording.events["y"].max() < 64


def test_a_recording_is_whole(short):
    assert len(short.events) > 1000
    assert np.all(np.diff(short.events["t_us"]) >= 0)
    assert len(short.frames) == len(short.frames_t_us) > 3
    assert short.truth.t_us[0] == 0 and short.truth.t_us[-1] >= 0.245e6


@pytest.mark.parametrize("name", ["test-dim", "augmented", "augmented--1", "", "hard-slow-2", "realistic-1 "])
def test_unknown_names(name):
    with pytest.raises(InputError, match="unknown"):
        sequences.simulate(name, 1.0)


@pytest.mark.parametrize("seconds", [0, -1, float("nan"), float("inf"), 1e9])
def test_impossible_lengths(seconds):
    with pytest.raises(InputError, match="seconds"):
        sequences.simulate("test-low", seconds)


def test_test_sequences_differ_in_light_alone():
    t = np.linspace(0, 5, 11)
    low, high = (
        laboratory.sequence_motion(laboratory.sequence(f"test-{level}"), t) for level in ("low", "high")
    )
    assert np.array_equal(low.position_m, high.position_m)
    assert np.array_equal(low.rotation, high.rotation)
    training = laboratory.sequence_motion(laboratory.sequence("realistic-1"), t)
    assert not np.allclose(training.position_m, low.position_m)


def test_speeds_are_an_arms():
    for name in ("test-low", "realistic-3", "augmented-5"):
        t = np.linspace(0, 60, 6001)
        pose = laboratory.sequence_motion(laboratory.sequence(name), t)
        speed = np.linalg.norm(np.diff(pose.position_m, axis=0), axis=1) / 0.01
        assert speed.max() < 0.5  # m/s
    t = np.linspace(0, 10, 101)
    slow = laboratory.sequence_motion(laboratory.sequence("hard-slow"), t)
    assert np.linalg.norm(np.diff(slow.position_m, axis=0), axis=1) / 0.1 == pytest.approx(0.0015)


@pytest.mark.parametrize("number", [1, 2, 101])
def test_a_named_speed_is_the_mean_speed_on_one_path(number):
    slow, fast = (laboratory.sequence(f"speed-{mm_s}-{number}") for mm_s in ("1.5", "150"))
    t_s = np.linspace(0, 60 / fast.speed, 2001)
    position_m = laboratory.sequence_motion(fast, t_s).position_m
    length_m = np.sum(np.linalg.norm(np.diff(position_m, axis=0), axis=1))
    assert length_m / t_s[-1] == pytest.approx(0.150, rel=1e-2)
    same = laboratory.sequence_motion(slow, 100 * t_s).position_m
    np.testing.assert_allclose(same, position_m, atol=1e-9)
    assert slow.light == fast.light and slow.skin == fast.skin


@pytest.mark.parametrize("step_px", [0.3, sequences.STEP_PX])
def test_motion_between_renders_stays_under_a_pixel(step_px):
    seq, port, camera = laboratory.sequence("test-low"), Port.lm_map(), Camera.davis346()
    times = sequences.render_times_us(seq, port, camera, 3.0, step_px)
    poses = laboratory.sequence_motion(seq, times * 1e-6)
    ring = circle_points_m(port.ring_outer_radius_m, 12)
    points = project(np.einsum("nij,kj->nki", poses.rotation, ring) + poses.position_m[:, None], camera)
    assert np.linalg.norm(np.diff(points, axis=0), axis=-1).max() < 1.1 * step_px


def test_labels_are_the_projected_cad():
    """Ring and markers of the ray caster against OpenCV's polygons, where nothing hides them."""
    port, camera = Port.lm_map(), Camera.davis346()
    pose = laboratory.sequence_motion(laboratory.sequence("test-low"), np.array([0.5]))[0]
    ring, markers = labels.label_masks(pose, port, camera)
    drawn = np.zeros((2, 260, 346), np.uint8)
    for radius, value in ((port.ring_outer_radius_m, 1), (port.ring_inner_radius_m, 0)):
        polygon = project(pose @ circle_points_m(radius, 180), camera)
        cv2.fillPoly(drawn[0], [np.round(polygon * 256).astype(np.int32)], value, shift=8)
    for corners in port.marker_corners_m():
        polygon = project(pose @ corners, camera)
        cv2.fillPoly(drawn[1], [np.round(polygon * 256).astype(np.int32)], 1, shift=8)
    outline = np.stack([cv2.dilate(image, np.ones((3, 3))) for image in drawn]) > 0
    assert ring.sum() > 0.6 * drawn[0].sum() and not np.any(ring & ~outline[0])
    assert markers.sum() > 0.5 * drawn[1].sum() and not np.any(markers & ~outline[1])
    assert not np.any(ring & markers)


def test_empty_has_no_port():
    recording = sequences.simulate("empty-0", 0.2)
    assert recording.truth is None
    assert len(recording.frames) > 0
