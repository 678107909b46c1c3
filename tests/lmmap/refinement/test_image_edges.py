"""A pose goes to the image's edges, and stays where there are none."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lmmap.geometry.port import ideal_masks
from lmmap.geometry.projection import project
from lmmap.geometry.rotations import move, rotation_z
from lmmap.pipeline import outline
from lmmap.refinement import image_edges
from lmmap.settings import OURS
from lmmap.types import Camera, Port, Pose

CAMERA, PORT = Camera.davis346(), Port.lm_map()
COVARIANCE = np.diag([0.002**2] * 2 + [0.005**2] + [0.03**2] * 3 + [1.0])
STEP = np.array([0.001, -0.001, 0.004, 0.02, -0.02, 0.015])


def pose(yaw_rad=0.3) -> Pose:
    turn = Rotation.from_rotvec([0.25, -0.3, 0]) * Rotation.from_rotvec([np.pi, 0, 0])
    return Pose(turn.as_matrix() @ rotation_z(np.array(yaw_rad)), np.array([0.02, -0.01, 0.45]))


def frame(T: Pose) -> np.ndarray:
    """A bright ring behind a plate of mid brightness, blurred as by the lens."""
    light = 30 + 150 * ideal_masks(T, PORT, CAMERA)[0]
    angle = (np.arange(6) + 0.5) * np.pi / 3
    plate = PORT.plate_circumradius_m * np.stack([np.cos(angle), np.sin(angle)], -1)
    plate = np.column_stack([plate, np.full(6, PORT.plate_height_m)])
    outline_px = np.rint(64 * project(T @ plate, CAMERA)).astype(np.int32)
    drawn = cv2.fillPoly(np.zeros(light.shape, np.uint8), [outline_px], 1, shift=6, lineType=cv2.LINE_8)
    light = np.where(drawn, 90, light).astype(np.float32)
    return cv2.GaussianBlur(light, (0, 0), 0.8)[..., None].repeat(3, 2).astype(np.uint8)


def errors(T: Pose, truth: Pose) -> tuple[float, float]:
    turn = Rotation.from_matrix(T.rotation @ truth.rotation.T).magnitude()
    return float(np.linalg.norm(T.position_m - truth.position_m)), float(turn)


def moved(T: Pose, step) -> Pose:
    return move(T, np.asarray(step))


@pytest.mark.parametrize("sign", [1, -1])
def test_a_pose_near_the_truth_comes_nearer(sign):
    truth = pose()
    start = moved(truth, sign * STEP)
    strength, settings = outline.edges(frame(truth)), replace(OURS, edge_rounds=8)
    refined, _, covariance = image_edges.refine(start, 0.0, COVARIANCE, strength, PORT, CAMERA, settings)
    for before, after in zip(errors(start, truth), errors(refined, truth), strict=True):
        assert after < 0.5 * before
    assert np.all(np.linalg.eigvalsh(COVARIANCE - covariance) > 0)  # edges add information


def test_without_edges_the_pose_stays():
    start = moved(pose(), STEP)
    refined, _, covariance = image_edges.refine(start, 0.0, COVARIANCE, np.zeros((260, 346)), PORT, CAMERA)
    assert refined is start and np.array_equal(covariance, COVARIANCE)


def test_a_sure_pose_is_not_moved():
    """The pose before counts as its covariance says."""
    truth = pose()
    start, strength = moved(truth, STEP), outline.edges(frame(truth))
    sure, *_ = image_edges.refine(start, 0.0, 1e-8 * COVARIANCE, strength, PORT, CAMERA)
    assert max(errors(sure, start)) < 1e-5


def test_a_third_of_a_turn_makes_no_difference():
    """The port repeats; so do its points."""
    settings = replace(OURS, edge_least=3.0)
    truth = pose()
    strength = outline.edges(frame(truth))
    refined = []
    for k in (0, 2):
        start = moved(truth, STEP)
        start = Pose(start.rotation @ rotation_z(k * np.pi / 3), start.position_m)
        refined.append(image_edges.refine(start, 0.0, COVARIANCE, strength, PORT, CAMERA, settings)[0])
    np.testing.assert_allclose(refined[0].position_m, refined[1].position_m, atol=1e-9)
    np.testing.assert_allclose(refined[0].normal, refined[1].normal, atol=1e-9)


def test_a_higher_plate_is_told_from_another_pose():
    """By its rim, against the ring."""
    truth, settings = pose(), replace(OURS, edge_rounds=8)
    strength = outline.edges(frame(truth))
    lower = replace(PORT, plate_height_m=PORT.plate_height_m / 1.1)
    refined, higher, covariance = image_edges.refine(
        truth, 0.0, COVARIANCE, strength, lower, CAMERA, settings
    )
    sigma = np.sqrt(covariance[6, 6])
    assert sigma < 0.6 and higher > sigma and abs(higher - 0.1 / PORT.plate_height_tolerance) < 3 * sigma
    assert errors(refined, truth)[1] < np.deg2rad(0.7)
