"""The overlay shows what was estimated where it was estimated."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from conftest import facing_pose

from lmmap.geometry.conics import circle_ellipse
from lmmap.geometry.projection import project, rescale_px
from lmmap.pages.overlay import AXES, BGR, Overlay, draw
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
    picture = draw(DARK, FOUND, NO_MASK, PORT, camera)
    for axis, colour in zip(np.eye(3), AXES, strict=True):
        assert near(picture, project(T @ (0.7 * PORT.ring_radius_m * axis), camera), colour)
    a = np.linspace(0, 6, 9)
    ring = PORT.ring_radius_m * np.stack([np.cos(a), np.sin(a), 0 * a], -1)
    assert np.mean([near(picture, p, BGR["ellipse"]) for p in project(T @ ring, camera)]) > 0.7


def test_mask_status_and_uncertainty_show():
    plain = draw(DARK, Estimate(0, Status.NO_RING), NO_MASK, PORT, CAMERA)
    assert plain.shape == (2 * 260 + 28, 2 * 346, 3)
    assert not plain[:520].any() and plain[520:].any()  # nothing but its caption
    mask = NO_MASK.copy()
    mask[100:110, 50:60] = 1
    tinted = draw(DARK, Estimate(0, Status.NO_RING), mask, PORT, CAMERA)
    assert tinted[200:220, 100:120].min(axis=(0, 1)).max() > 100 and not tinted[:190].any()
    histogram = np.zeros((260, 346), np.uint16)
    histogram[10, 20] = 3
    assert draw(histogram, Estimate(0, Status.NO_RING), NO_MASK, PORT, CAMERA)[20, 40].tolist() == [255] * 3


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


def test_what_is_no_video(tmp_path):
    for path in (tmp_path / "o.gif", tmp_path / "no" / "o.mp4"):
        with pytest.raises(InputError, match=path.name):
            Overlay(path, PORT, CAMERA)
