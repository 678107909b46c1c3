"""The outline of rim, markers and petals tells normal and yaw, whatever the brightness."""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lmmap.geometry.conics import circle_ellipse
from lmmap.geometry.projection import project
from lmmap.geometry.rotations import rotation_z
from lmmap.pipeline import circle, outline, yaw
from lmmap.settings import OURS
from lmmap.types import Camera, Port, Pose

CAMERA, PORT = Camera.davis346(), Port.lm_map()
YAWS = 120
YAW_RAD = np.deg2rad(np.arange(YAWS))


def pose(tilt_rad=(0.3, -0.2), yaw_rad=0.4) -> Pose:
    turn = Rotation.from_rotvec([*tilt_rad, 0]) * Rotation.from_rotvec([np.pi, 0, 0])
    return Pose(turn.as_matrix() @ rotation_z(np.array(yaw_rad)), np.array([0.02, -0.01, 0.5]))


def drawing(T: Pose, parts=("rim", "markers", "tips")) -> np.ndarray:
    """A histogram with ten events on each pixel of the parts' lines."""
    image = np.zeros((CAMERA.height_px, CAMERA.width_px), np.uint8)
    angle = np.arange(6) * np.pi / 3 + np.pi / 6
    hexagon = PORT.plate_circumradius_m * np.stack([np.cos(angle), np.sin(angle)], -1)
    lines = {"rim": [np.column_stack([hexagon, np.full(6, PORT.plate_height_m)])],
             "markers": list(PORT.marker_corners_m())}  # fmt: skip
    tip_m, height_m = PORT.apothem_m + PORT.petal_lean_m, PORT.plate_height_m + PORT.petal_rise_m
    side = np.array([[tip_m, s * PORT.petal_widths_m[1] / 2, height_m] for s in (-1, 1)])
    lines["tips"] = [side @ rotation_z(np.array(k * PORT.yaw_period_rad)).T for k in range(PORT.symmetry)]
    for part in parts:
        for line_m in lines[part]:
            corners = np.rint(16 * project(T @ line_m, CAMERA)).astype(np.int32)
            cv2.polylines(image, [corners], len(corners) > 2, 10, shift=4)
    return image.astype(np.uint16)


def support(image, T: Pose) -> np.ndarray:
    return outline.support(
        outline.edges(image), Pose(T.rotation[None], T.position_m[None]), PORT, CAMERA, YAWS
    )[0]


def test_each_part_is_strongest_at_the_true_yaw():
    T = pose()
    for k, part in enumerate(("rim", "markers", "tips")):
        curve = support(drawing(T, [part]), T)[:, k]
        assert min(curve.argmax(), YAWS - curve.argmax()) % 60 <= 1  # the rim cannot tell 60 deg
        assert curve.max() > 1.5 * np.median(curve)


def test_a_turn_of_the_pose_shifts_the_curves():
    T = pose()
    turned = Pose(T.rotation @ rotation_z(YAW_RAD[25]), T.position_m)
    image = drawing(T)
    assert np.allclose(support(image, turned), np.roll(support(image, T), -25, axis=0), atol=1e-4)


def test_the_rim_repeats_after_sixty_degrees_and_the_markers_do_not():
    rim, markers, _ = support(drawing(pose()), pose()).T
    assert np.allclose(rim, np.roll(rim, 60), atol=0.1 * rim.max())
    assert markers[0] > 1.5 * markers[60]


def test_edges_of_a_frame_do_not_depend_on_its_brightness():
    rng = np.random.default_rng(0)
    frame = 30 * (rng.random((26, 34)) < 0.5).repeat(10, 0).repeat(10, 1)[..., None].repeat(3, 2)
    dim, bright = (outline.edges((frame * gain).astype(np.uint8)) for gain in (1, 8))
    assert np.median(np.abs(bright - dim)[dim > 1] / dim[dim > 1]) < 0.2
    assert not outline.edges(np.full_like(frame, 200, np.uint8)).any()


@pytest.mark.parametrize("kind", ["event", "rgb"])
def test_the_image_decides_where_the_mask_cannot(kind):
    """A faint mask that shows both yaws alike, and an image of the true one."""
    T = pose()
    pair = circle.poses(circle_ellipse(T, PORT.ring_radius_m, CAMERA), CAMERA, PORT.ring_radius_m)
    image = drawing(T)
    if kind == "rgb":
        image = (12 * image[..., None]).repeat(3, 2).astype(np.uint8)
    at, other = (
        drawing(Pose(T.rotation @ rotation_z(np.array(a)), T.position_m), ["markers"]) for a in (0, np.pi / 3)
    )
    mask = cv2.GaussianBlur(0.05 * np.maximum(at, other).astype(np.float32), (0, 0), 2)
    fit = yaw.fast_yaw(mask, pair, PORT, CAMERA, OURS, outline.edges(image), OURS.yaw_weights[kind])
    turn = fit.T_cam_port.rotation.T @ T.rotation
    off_rad = (np.arctan2(turn[1, 0], turn[0, 0]) + np.pi / 3) % (2 * np.pi / 3) - np.pi / 3
    assert abs(off_rad) < np.deg2rad(2) and fit.T_cam_port.normal @ T.normal > np.cos(np.deg2rad(1))
    assert fit.log_odds > 2


def test_log_odds_by_hand():
    """Of two normals far apart with four yaws, the best has three times the rest's probability."""
    pair = Pose(np.stack([np.eye(3), Rotation.from_rotvec([0.5, 0, 0]).as_matrix()]), np.zeros((2, 3)))
    p = np.array([[6.0, 0.5, 0.5, 0.5], [0.5, 0, 0, 0]])
    with np.errstate(divide="ignore"):
        assert outline.log_odds(np.log(p) + 7, pair, PORT, OURS) == pytest.approx(np.log(3))
    alike = Pose(np.stack([np.eye(3)] * 2), np.zeros((2, 3)))  # head-on the two normals are one
    with np.errstate(divide="ignore"):
        assert outline.log_odds(np.log(p), alike, PORT, OURS) == pytest.approx(np.log(6.5 / 1.5))
