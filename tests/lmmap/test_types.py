import json
import re
from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from strategies import rigid_poses

from lmmap.types import (
    EVENT,
    Camera,
    Ellipse,
    Estimate,
    InputError,
    Port,
    Pose,
    Recording,
    Status,
    Trajectory,
)
from lmmap.types.recording import CHUNK_EVENTS


@given(rigid_poses())
def test_a_pose_times_its_inverse_is_the_identity(T):
    for product in (T @ T.inverse, T.inverse @ T):
        np.testing.assert_allclose(product.rotation, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(product.position_m, 0, atol=1e-12)


@given(rigid_poses(), rigid_poses(), st.tuples(*[st.floats(-5, 5)] * 3))
def test_composition_acts_as_one_after_the_other(T_a_b, T_b_c, p_c):
    np.testing.assert_allclose((T_a_b @ T_b_c) @ np.array(p_c), T_a_b @ (T_b_c @ np.array(p_c)), atol=1e-12)


def test_batches_of_poses_compose_like_single_ones():
    rng = np.random.default_rng(0)
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    batch = Pose(np.stack([np.eye(3), turn]), rng.normal(size=(2, 3)))
    points = rng.normal(size=(2, 3))
    for k in range(2):
        np.testing.assert_array_equal((batch @ points)[k], batch[k] @ points[k])
        np.testing.assert_allclose((batch @ batch).position_m[k], (batch[k] @ batch[k]).position_m)


def test_arrays_inside_the_dataclasses_are_copies_and_read_only():
    position = np.zeros(3)
    T = Pose(np.eye(3), position)
    position[0] = 1
    assert T.position_m[0] == 0
    with pytest.raises(ValueError, match="read-only"):
        T.position_m[0] = 1


def test_the_quaternion_of_a_quarter_turn_about_z():
    T = Pose(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.zeros(3))
    np.testing.assert_allclose(T.quaternion_xyzw, [0, 0, np.sqrt(0.5), np.sqrt(0.5)])


@pytest.mark.parametrize(
    "t_us", [[2**63], [2**70], [np.nan], [np.inf], [1e300], ["0"], [None], np.array([2**64 - 1], np.uint64)]
)
def test_times_of_a_trajectory_that_are_none(t_us):
    with pytest.raises(ValueError, match=r"Trajectory: t_us: expected .*, got "):
        Trajectory(t_us, Pose(np.eye(3)[None], np.zeros((1, 3))))


@pytest.mark.parametrize("count", [0, 1])
def test_no_pose_between_less_than_two(count):
    path = Trajectory(np.arange(count), Pose(np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))))
    with pytest.raises(ValueError, match=f"expected at least two poses to interpolate, got {count}"):
        path.at([0])


def test_trajectories_interpolate_half_way_and_refuse_to_extrapolate():
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    path = Trajectory([0, 100], Pose(np.stack([np.eye(3), turn]), [[0, 0, 1], [2, 0, 1]]))
    middle = path.at([50])
    np.testing.assert_allclose(middle.position_m, [[1, 0, 1]])
    np.testing.assert_allclose(middle.rotation[0, :2, 0], [np.sqrt(0.5), np.sqrt(0.5)])
    with pytest.raises(ValueError, match=r"t_us: expected times within \[0, 100\] us"):
        path.at([101])


def with_gap(step_us, gap_us, count=80) -> Trajectory:
    """A steady motion whose middle is missing."""
    t_us = step_us * np.arange(count)
    t_us[count // 2 :] += gap_us - step_us
    return Trajectory(t_us, Pose(np.tile(np.eye(3), (count, 1, 1)), np.outer(t_us, [1e-6, 0, 0])))


@pytest.mark.parametrize("step_us, gap_us", [(10_000, 1_500_000), (1000, 150_000), (100_000, 1_100_000)])
def test_a_trajectory_knows_nothing_in_a_gap(step_us, gap_us):
    truth = with_gap(step_us, gap_us)
    before_us, after_us = truth.t_us[[39, 40]]
    inside = np.array([before_us + 1, (before_us + after_us) // 2, after_us - 1])
    around = np.array([0, step_us // 2, before_us - 1, before_us, after_us, after_us + 1, truth.t_us[-1]])
    assert not truth.covers(inside).any() and truth.covers(around).all()
    np.testing.assert_allclose(truth.at(around).position_m[:, 0], around * 1e-6, atol=1e-12)
    for t_us in inside.tolist():
        with pytest.raises(ValueError, match=f"t_us: expected times in no gap, got {t_us} us"):
            truth.at(t_us)
        assert truth.at(t_us, across_gaps=True).position_m[0] == pytest.approx(t_us * 1e-6)
    assert not truth.covers(np.array([-1, truth.t_us[-1] + 1])).any()


@pytest.mark.parametrize("step_us, gap_us", [(10_000, 90_000), (100_000, 900_000), (1000, 99_000)])
def test_a_few_poses_that_are_missing_are_no_gap(step_us, gap_us):
    truth = with_gap(step_us, gap_us)
    assert truth.covers(np.arange(truth.t_us[-1])[:: step_us // 7]).all()


def test_trajectories_refuse_times_that_do_not_increase():
    poses = Pose(np.stack([np.eye(3)] * 2), np.zeros((2, 3)))
    with pytest.raises(ValueError, match="increase"):
        Trajectory([5, 5], poses)
    with pytest.raises(ValueError, match=r"expected as many times as poses \(N,\), got \(3,\) and \(2,\)"):
        Trajectory([1, 2, 3], poses)


def test_ellipse_points_reach_the_ends_of_the_axes():
    points = Ellipse([10, 20], [4, 2], np.pi / 2).points(4)
    np.testing.assert_allclose(points, [[10, 24], [8, 20], [10, 16], [12, 20]], atol=1e-12)


@pytest.mark.parametrize("axes", [(2, 4), (30.0, 30.1), [(4, 2), (2, 4)]])
def test_the_first_axis_of_an_ellipse_is_the_larger_one(axes):
    with pytest.raises(ValueError, match="major first"):
        Ellipse([10, 20], axes, 0.5)
    Ellipse([10, 20], [30.0, 30.0], 0.5)
    Ellipse([10, 20], [np.nan, np.nan], 0.5)


def test_camera_and_port_survive_the_round_trip_through_their_files(tmp_path):
    camera = Camera(640, 480, 500.0, 501.0, 320.5, 239.5, (0.1, -0.2, 0.0, 0.001))
    for instance in (camera, Camera.davis346(), Port.lm_map()):
        instance.save(tmp_path / "x.json")
        assert type(instance).load(tmp_path / "x.json") == instance


ROS = """image_width: 346
image_height: 260
camera_name: davis
camera_matrix: {rows: 3, cols: 3, data: [324.0, 0, 172.5, 0, 325.0, 129.5, 0, 0, 1]}
distortion_coefficients: {rows: 1, cols: 5, data: [-0.3, 0.1, 0.0, 0.0, 0.0]}
"""
OPENCV = """%YAML:1.0
---
image_width: 346
image_height: 260
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 324., 0., 172.5, 0., 325., 129.5, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -0.3, 0.1, 0., 0., 0. ]
"""


@pytest.mark.parametrize("text", [ROS, OPENCV], ids=["ros", "opencv"])
def test_cameras_load_from_calibration_yaml(tmp_path, text):
    (tmp_path / "camera.yaml").write_text(text)
    expected = Camera(346, 260, 324.0, 325.0, 172.5, 129.5, (-0.3, 0.1, 0.0, 0.0, 0.0))
    assert Camera.load(tmp_path / "camera.yaml") == expected


@pytest.mark.parametrize("text", ["", "hello", "[1, 2]", "{}", '{"width_px": 346}', "\x00"])
@pytest.mark.parametrize("load", [Camera.load, Port.load])
@pytest.mark.parametrize("suffix", [".json", ".yaml"])
def test_bad_files_are_one_line_that_names_the_file(tmp_path, text, load, suffix):
    path = tmp_path / f"bad{suffix}"
    path.write_text(text)
    with pytest.raises(InputError, match="bad") as caught:
        load(path)
    assert "\n" not in str(caught.value)


def test_a_camera_with_nonsense_in_it_is_refused(tmp_path):
    values = json.loads('{"width_px": 346, "height_px": 260, "fy_px": 1, "cx_px": 1, "cy_px": 1}')
    for focal in (-1.0, 0.0, float("nan")):
        with pytest.raises(ValueError, match="fx_px: expected a number"):
            Camera(fx_px=focal, **values)


def test_markers_repeat_with_the_symmetry_and_have_their_size():
    port = Port.lm_map()
    corners = port.marker_corners_m()
    assert corners.shape == (3, 4, 3)
    sides = np.linalg.norm(np.diff(corners, axis=1), axis=-1)
    np.testing.assert_allclose(sides, [[0.0161, 0.0536, 0.0161]] * 3)
    np.testing.assert_allclose(corners.mean(1)[0], [port.marker_radius_m, 0, port.plate_height_m], atol=1e-15)
    np.testing.assert_allclose(corners.mean((0, 1)), [0, 0, port.plate_height_m], atol=1e-15)


def test_windows_lie_half_way_between_the_markers():
    port = replace(Port.lm_map(), window_radius_m=0.030, window_size_m=(0.02, 0.016))
    corners = port.window_corners_m()
    assert corners.shape == (3, 4, 3)
    sides = np.linalg.norm(np.diff(corners, axis=1), axis=-1)
    np.testing.assert_allclose(sides, [[0.016, 0.02, 0.016]] * 3)
    middles, markers = corners.mean(1)[:, :2], port.marker_corners_m().mean(1)[:, :2]
    np.testing.assert_allclose(np.linalg.norm(middles, axis=1), 0.030)
    cosines = middles @ markers.T / (0.030 * port.marker_radius_m)
    np.testing.assert_allclose(np.sort(cosines), [[-1, 0.5, 0.5]] * 3, atol=1e-12)  # one stands opposite
    assert replace(port, window_size_m=(0.0, 0.0)).window_corners_m().shape == (0, 4, 3)


def test_a_port_file_without_windows_or_tolerances_is_read(tmp_path):
    """Files of the first versions; what they do not say has its default."""
    port = replace(Port.lm_map(), window_radius_m=0.0, window_size_m=(0.0, 0.0))
    path = tmp_path / "port.json"
    port.save(path)
    values = json.loads(path.read_text())
    path.write_text(json.dumps({k: v for k, v in values.items() if "window" not in k and "toler" not in k}))
    assert Port.load(path) == port
    own = replace(port, plate_height_tolerance=0.03)
    own.save(path)
    assert Port.load(path) == own


def test_an_estimate_shows_itself_in_a_notebook():
    """A port 0.5 m ahead whose normal leans 30 deg from the optical axis; where there is no pose, why."""
    turn = Rotation.from_euler("x", np.pi - np.deg2rad(30)).as_matrix()
    T, covariance = Pose(turn, [0.02, -0.01, 0.5]), 4e-6 * np.eye(6)
    html = Estimate(1_500_000, Status.OK, T, covariance=covariance)._repr_html_()
    for text in ("1.500000 s", "x 20.0, y -10.0, z 500.0 mm", "30.0°", "x 2.0, y 2.0, z 2.0 mm"):
        assert text in html
    assert "no_ring" in Estimate(0, Status.NO_RING)._repr_html_()
    assert "standard deviation" not in Estimate(0, Status.OK, Pose(turn, [0, 0, 1]))._repr_html_()


def test_help_names_every_field_of_an_estimate():
    for field in fields(Estimate):
        assert re.search(rf"^ *(\w+, )?{field.name}(, \w+)? : ", Estimate.__doc__, re.M), field.name


def test_a_recordings_chunks_are_views_that_make_up_its_events():
    """Also of one without events, whose one chunk is empty."""
    for count in (0, 1, CHUNK_EVENTS, 2 * CHUNK_EVENTS + 1):
        events = np.zeros(count, EVENT)
        events["t_us"] = np.arange(count)
        chunks = list(Recording("r", Camera.davis346(), events, np.zeros(0), np.zeros(0)).chunks())
        assert len(chunks) == max(-(-count // CHUNK_EVENTS), 1)
        assert all(np.shares_memory(chunk, events) for chunk in chunks if count)
        np.testing.assert_array_equal(np.concatenate(chunks), events)


@given(rigid_poses(), rigid_poses())
def test_stacked_poses_are_what_they_were_one_after_another(one, other):
    three = Pose.stack([one, Pose.stack([other, one])])
    assert len(three) == 3 and len(Pose.stack([])) == 0
    for k, T in enumerate([one, other, one]):
        assert np.array_equal(three[k].rotation, T.rotation)
        assert np.array_equal(three[k].position_m, T.position_m)
