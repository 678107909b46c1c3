"""The overlay shows what was estimated where it was estimated."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from strategies import facing_pose

from lmmap.drawing.overlay import AXES, COLOUR, Overlay, draw
from lmmap.geometry.conics import circle_ellipse
from lmmap.geometry.projection import project, rescale_px
from lmmap.types import Camera, Estimate, InputError, Port, Status

CAMERA, PORT = Camera.davis346(), Port.lm_map()
T = facing_pose(0.5, 0.3, 0.2, [0.02, -0.01, 0.5])
FOUND = Estimate(1_500_000, Status.OK, T, ellipse=circle_ellipse(T, PORT.ring_radius_m, CAMERA))
DARK = np.zeros((260, 346, 3), np.uint8)
NO_MASK = np.zeros((260, 346), np.float32)


def near(picture, point_px, colour) -> bool:
    u, v = np.round(rescale_px(point_px, 2)).astype(int)
    patch = picture[v - 3 : v + 4, u - 3 : u + 4].reshape(-1, 3).astype(int)
    return bool((np.abs(patch - colour).sum(1) < 60).any())


@pytest.mark.parametrize("distortion", [(), (-0.2, 0.05, 0.001, -0.002)])
def test_axes_and_ring_lie_where_the_camera_sees_them(distortion):
    camera = replace(CAMERA, distortion=distortion)
    picture = draw(DARK, FOUND, camera, PORT, NO_MASK)
    for axis, colour in zip(np.eye(3), AXES, strict=True):
        assert near(picture, project(T @ (0.7 * PORT.ring_radius_m * axis), camera), colour)
    a = np.linspace(0, 6, 9)
    ring = PORT.ring_radius_m * np.stack([np.cos(a), np.sin(a), 0 * a], -1)
    assert np.mean([near(picture, p, COLOUR["ellipse"]) for p in project(T @ ring, camera)]) > 0.7


def test_a_trackers_prediction_lies_beside_what_was_measured_and_its_confidence_shows():
    expected = facing_pose(0.5, 0.3, 0.2, [0.06, -0.01, 0.5])
    picture = draw(DARK, replace(FOUND, predicted=expected, confidence=0.93), CAMERA, PORT, NO_MASK)
    points_px = project(
        expected @ (PORT.ring_radius_m * np.array([[1.0, 0, 0], [0, 1, 0], [0, -1, 0]])), CAMERA
    )
    assert all(near(picture, p, COLOUR["predicted"]) for p in points_px)
    without = draw(DARK, FOUND, CAMERA, PORT, NO_MASK)
    assert not near(without, points_px[0], COLOUR["predicted"])
    assert np.any(picture[520:] != without[520:])


def test_mask_status_and_uncertainty_show():
    plain = draw(DARK, Estimate(0, Status.NO_RING), CAMERA, PORT, NO_MASK)
    assert plain.shape == (2 * 260 + 28, 2 * 346, 3)
    assert not plain[:520].any() and plain[520:].any()  # nothing but its caption
    mask = NO_MASK.copy()
    mask[100:110, 50:60] = 1
    tinted = draw(DARK, Estimate(0, Status.NO_RING), CAMERA, PORT, mask)
    assert tinted[200:220, 100:120].min(axis=(0, 1)).max() > 100 and not tinted[:190].any()
    histogram = np.zeros((260, 346), np.uint16)
    histogram[10, 20] = 3
    assert draw(histogram, Estimate(0, Status.NO_RING), CAMERA, PORT, NO_MASK)[20, 40].tolist() == [255] * 3


@pytest.mark.parametrize("count", [1, 4])
def test_a_video_has_every_picture_at_the_images_rate(tmp_path, count):
    with Overlay(tmp_path / "o.mp4", PORT, CAMERA) as overlay:
        for k in range(count):
            overlay.add(DARK, replace(FOUND, t_us=50_000 * k), NO_MASK)
    film, pictures = cv2.VideoCapture(str(tmp_path / "o.mp4")), 0
    assert film.get(cv2.CAP_PROP_FPS) == pytest.approx(20 if count > 1 else 1)
    while film.read()[0]:
        pictures += 1
    assert pictures == count


def test_an_mp4_is_one_that_browsers_play(tmp_path):
    """VP9 in MP4: the box that describes the track is named vp09, not mp4v, which no browser plays."""
    with Overlay(tmp_path / "o.mp4", PORT, CAMERA) as overlay:
        for k in range(3):
            overlay.add(DARK, replace(FOUND, t_us=50_000 * k))
    content = (tmp_path / "o.mp4").read_bytes()
    description = content[content.index(b"stsd") :][:24]
    assert content[4:8] == b"ftyp" and description[16:20] == b"vp09"
    fourcc = int(cv2.VideoCapture(str(tmp_path / "o.mp4")).get(cv2.CAP_PROP_FOURCC))
    assert fourcc.to_bytes(4, "little") == b"VP90"


def test_a_picture_needs_no_more_than_an_image_and_its_estimate():
    """Colours are RGB; the bench's camera and port are the defaults; no mask is no tint."""
    grey = np.full((260, 346, 3), (10, 20, 30), np.uint8)
    picture = draw(grey, Estimate(0, Status.NO_RING))
    assert picture[0, 0].tolist() == [10, 20, 30]
    np.testing.assert_array_equal(draw(DARK, FOUND), draw(DARK, FOUND, CAMERA, PORT, NO_MASK))
    with pytest.raises(ValueError, match=r"draw: expected an image of .*\(260, 346\).*got \(48, 64, 3\)"):
        draw(np.zeros((48, 64, 3), np.uint8), FOUND)


def test_what_is_no_video(tmp_path):
    for path in (tmp_path / "o.gif", tmp_path / "no" / "o.mp4"):
        with pytest.raises(InputError, match=path.name):
            Overlay(path, PORT, CAMERA)
