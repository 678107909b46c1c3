"""Images of other lenses: the same pose through any of them."""

import warnings
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import CAMERA, PORT, WIDE, off, pose, visible_poses

from lmmap.geometry.conics import circle_ellipse
from lmmap.geometry.port import ideal_masks
from lmmap.geometry.projection import project, undistort_points
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.rescale import ellipse_in, enlarged_cameras, network_camera, resample, trained_range_m
from lmmap.settings import OURS, PerCamera
from lmmap.types import Camera, Status

FISHEYE = Camera(640, 480, 260.0, 260.0, 319.5, 239.5, (0.01, -0.02, 0.003, 0.0), "equidistant")
cameras = st.builds(
    lambda f, ratio, lens: replace(lens, fx_px=f, fy_px=f * ratio),
    st.floats(80, 2000), st.floats(0.8, 1.25), st.sampled_from([CAMERA, WIDE, FISHEYE]),
)  # fmt: skip


@given(cameras, visible_poses())
def test_resampled_images_show_a_point_where_the_resampled_camera_sees_it(camera, T):
    """A pixel's place in the image, as a share of its size, is the same; the focal length is what it was to
    be, but for the half pixel by which a size is rounded."""
    grid = camera.at_focal(324.0)
    share, again = ((project(T.position_m, c) + 0.5) / c.size_px for c in (camera, grid))
    np.testing.assert_allclose(again, share, atol=1e-9)
    unrounded_px = np.array(camera.size_px) * 324 / (camera.fx_px, camera.fy_px)
    assert np.all(np.abs(np.array([grid.fx_px, grid.fy_px]) / 324 - 1) < (0.5 + 1e-9) / unrounded_px)


@given(cameras, visible_poses())
def test_an_undistorted_ellipse_is_the_circles_in_either_cameras_pixels(camera, T):
    grid = camera.at_focal(324.0)
    moved = ellipse_in(circle_ellipse(T, 0.08, grid), grid, camera)
    expected = circle_ellipse(T, 0.08, camera)
    np.testing.assert_allclose(moved.centre_px, expected.centre_px, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(moved.semi_axes_px, expected.semi_axes_px, rtol=1e-6)


@pytest.mark.parametrize("ratio", [1.0, 0.9, 1.1])
def test_a_lens_near_the_trained_one_is_taken_as_it_is(ratio):
    camera = replace(CAMERA, fx_px=324 * ratio, fy_px=324 * ratio)
    image = np.random.default_rng(0).integers(0, 255, (260, 346, 3), np.uint8)
    assert network_camera(camera, "event") is camera
    assert resample(image, camera) is image


def test_a_histogram_keeps_its_counts_a_pixel():
    counts = np.full((720, 1280), 3, np.uint16)
    for f_px in (1200.0, 150.0):
        camera = Camera(1280, 720, f_px, f_px, 639.5, 359.5)
        np.testing.assert_allclose(resample(counts, camera.at_focal(324.0)), 3, rtol=1e-6)


def masks_as_networks(T, camera):
    """Two networks that see the ideal masks of a pose, whatever the image."""
    ring, reflectors = ideal_masks(T, PORT, camera)
    return lambda image: ring, lambda image: reflectors


LENSES = {
    "720p": Camera(1280, 720, 1200.0, 1200.0, 639.5, 359.5),
    "small": Camera(240, 180, 225.0, 225.0, 119.5, 89.5),
    "oblong pixels": Camera(640, 480, 600.0, 500.0, 300.0, 240.0),
    "radial": Camera(640, 480, 600.0, 600.0, 319.5, 239.5, (-0.35, 0.12, 0.001, -0.0008, 0.0)),
    "equidistant": FISHEYE,
}


@pytest.mark.filterwarnings("ignore:lens of")
@pytest.mark.parametrize("name", LENSES)
def test_the_pose_and_its_ellipse_are_in_the_cameras_own_frame(name):
    """Ideal masks on the networks' grid give the pose, and the ellipse that the camera itself would see."""
    camera = LENSES[name]
    T = pose((200, 110), 0.7, 0.5, 1.0, 0.3)
    blank = np.zeros((*camera.size_px[::-1], 3), np.uint8)
    estimator = Estimator(camera, PORT, "rgb", masks_as_networks(T, network_camera(camera, "rgb")),
                          replace(OURS, min_confidence=PerCamera(0.0, 0.0)))  # fmt: skip
    estimate = estimator(blank)
    assert estimate.status == Status.OK
    normal_deg, position_mm = off(estimate.T_cam_port, T)
    assert position_mm < 2 and normal_deg < 1.5
    expected = circle_ellipse(T, PORT.ring_radius_m, camera)
    np.testing.assert_allclose(estimate.ellipse.centre_px, expected.centre_px, atol=0.004 * camera.width_px)
    np.testing.assert_allclose(estimate.ellipse.semi_axes_px, expected.semi_axes_px, rtol=0.02)
    assert estimator.ring_mask(blank).shape == camera.size_px[::-1]


@pytest.mark.filterwarnings("ignore:lens of")
def test_the_ring_mask_lies_where_the_camera_sees_the_ring():
    camera, T = LENSES["equidistant"], pose((172, 130), 0.6, 0.4)
    estimator = Estimator(camera, PORT, "rgb", masks_as_networks(T, network_camera(camera, "rgb")))
    mask = estimator.ring_mask(np.zeros((480, 640, 3), np.uint8))
    expected = ideal_masks(T, PORT, camera)[0]
    overlap = np.minimum(mask, expected).sum() / np.maximum(mask, expected).sum()
    assert overlap > 0.8


def test_the_equidistant_model_is_opencvs_fisheye():
    xy = np.random.default_rng(1).uniform(-1.5, 1.5, (50, 2))
    points = np.column_stack([xy, np.ones(50)])
    k = np.array(FISHEYE.distortion)
    expected = cv2.fisheye.projectPoints(points[None], np.zeros(3), np.zeros(3), FISHEYE.K, k)[0][0]
    np.testing.assert_allclose(project(points, FISHEYE), expected, atol=1e-9)
    np.testing.assert_allclose(
        undistort_points(expected, FISHEYE), project(points, replace(FISHEYE, distortion=())), atol=1e-6
    )


def test_a_lens_that_is_too_short_is_named_once_with_its_range():
    """Frames are enlarged twice, histograms never: their networks then see a smaller ring."""
    short = Camera(346, 260, 108.0, 108.0, 172.5, 129.5)
    assert network_camera(short, "event") is short
    assert network_camera(short, "rgb").fx_px == pytest.approx(216)
    assert trained_range_m(short, PORT)[1] == pytest.approx(108 * 0.08 / 21)
    masks = masks_as_networks(pose((172, 130), 0.6, 0.4), short)
    for modality in ("rgb", "event"):
        with pytest.warns(UserWarning, match=r"lens of 108 px.* to 0\.41 m") as warned:
            Estimator(short, PORT, modality, masks)
        assert len(warned) == 1
    with warnings.catch_warnings(action="error"):
        Estimator(LENSES["720p"], PORT, "event", masks)


def test_a_small_sensors_histogram_is_looked_at_again_enlarged():
    """The first look at 240 x 180 px shows no ring here; the pose of the second is as if it had been the
    first, and the ellipse is in the sensor's pixels."""
    small = Camera(240, 180, 225.0, 225.0, 119.5, 89.5)
    T = pose((120, 90), 0.5, 0.4)
    sizes = []

    def only_enlarged(network):
        def mask(image):
            sizes.append(image.shape)
            return network(image) if image.shape[0] > 180 else np.zeros(image.shape, np.float32)

        return mask

    masks = masks_as_networks(T, small.at_focal(270.0))
    with pytest.warns(UserWarning, match="lens of 225 px"):
        estimator = Estimator(small, PORT, "event", tuple(only_enlarged(n) for n in masks))
    estimate = estimator(np.zeros((180, 240), np.uint16))
    assert estimate.status == Status.OK and off(estimate.T_cam_port, T)[1] < 5
    np.testing.assert_allclose(estimate.ellipse.centre_px, circle_ellipse(T, 0.08, small).centre_px, atol=0.5)
    assert sizes[0] == (180, 240) and {s for s in sizes[1:]} == {(216, 288)}
    assert [c.fx_px for c in enlarged_cameras(small, "event")] == pytest.approx([270, 324], rel=0.01)
    assert not enlarged_cameras(small, "rgb") and not enlarged_cameras(CAMERA, "event")


def test_an_estimate_says_that_the_ring_is_larger_than_any_of_the_training():
    blank = np.zeros((260, 346, 3), np.uint8)
    for distance_m, outside in ((0.29, True), (0.6, False)):
        masks = masks_as_networks(pose((172, 130), distance_m, 0.3), CAMERA)
        assert Estimator(CAMERA, PORT, "rgb", masks)(blank).outside_training is outside
