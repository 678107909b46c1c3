"""Evidence for a pose, on ports drawn from the geometry."""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from strategies import CAMERA, PORT, pose

from lmmap.geometry.port import ideal_masks
from lmmap.refinement import verify
from lmmap.types import Pose

POSES = [pose((170, 125), z, np.deg2rad(t), a, y) for z, t, a, y in
         [(0.4, 5, 0, 0.2), (0.5, 20, 1, 0.5), (0.6, 35, 2.5, 1.5), (0.8, 30, 4, 0.1)]]  # fmt: skip
COVARIANCE = np.diag([1e-6] * 6)


def drawn(T):
    """A frame (H, W, 3) of a bright ring and markers on grey, and both masks (2, H, W)."""
    masks = ideal_masks(T, PORT, CAMERA)
    light = cv2.GaussianBlur(40 + 120 * masks.max(0), (0, 0), 0.8)
    return np.repeat(light[..., None], 3, 2), np.array([cv2.GaussianBlur(m, (0, 0), 0.8) for m in masks])


def turned(T: Pose, axis, angle_deg: float) -> Pose:
    turn = Rotation.from_rotvec(np.deg2rad(angle_deg) * np.asarray(axis, float)).as_matrix()
    return Pose(turn @ T.rotation, T.position_m)


def evidence(T, image, masks, log_odds=10.0, markers_off_px=0.0):
    return verify.evidence(T, COVARIANCE, markers_off_px, log_odds, image, *masks, PORT, CAMERA)


@pytest.mark.parametrize("T", POSES)
def test_a_pose_ten_degrees_off_is_likelier_wrong_and_another_yaw_five_times(T):
    """At equal standard deviations and log odds; those of a fit get worse as well."""
    image, masks = drawn(T)
    doubt = 1 - verify.confidence(evidence(T, image, masks))
    assert doubt < 0.001
    for axis in ([1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]):
        assert 1 - verify.confidence(evidence(turned(T, axis, 10), image, masks)) > 1.05 * doubt
    half_period_deg = np.rad2deg(PORT.yaw_period_rad) / 2
    other_yaw = turned(T, T.normal, half_period_deg)
    assert 1 - verify.confidence(evidence(other_yaw, image, masks)) > 5 * doubt


@pytest.mark.parametrize("T", POSES)
def test_at_the_true_pose_mask_and_image_agree_with_the_port(T):
    image, masks = drawn(T)
    inside, edge = verify.ring_evidence(masks[0], image, T, PORT, CAMERA)
    assert inside < 0.01 and edge > 0.9
    assert verify.marker_evidence(masks[1], T, PORT, CAMERA) > 0.95


@pytest.mark.parametrize("T", POSES)
def test_of_a_ring_too_large_the_mask_lies_inside_and_the_edge_elsewhere(T):
    image, masks = drawn(T)
    larger = [Pose(T.rotation, T.position_m / scale) for scale in (1.1, 1.2)]
    (_, edge), (inside, _) = (verify.ring_evidence(masks[0], image, L, PORT, CAMERA) for L in larger)
    assert inside > 0.3 and edge < 0.1


@pytest.mark.parametrize("gain", [0.25, 3.0])
def test_evidence_does_not_change_with_the_image_s_gain(gain):
    image, masks = drawn(POSES[1])
    before, after = (evidence(POSES[1], k * image, masks) for k in (1, gain))
    np.testing.assert_allclose(after, before, atol=0.02)


def test_less_certain_poses_are_less_confident():
    image, masks = drawn(POSES[1])

    def confidence(covariance, log_odds=3.0):
        of_pose = covariance, 0.0, log_odds, image, *masks, PORT, CAMERA
        return float(verify.confidence(verify.evidence(POSES[1], *of_pose)))

    base = confidence(COVARIANCE)
    assert confidence(100 * COVARIANCE) < base
    assert confidence(COVARIANCE, log_odds=0.0) < base


def test_markers_off_where_the_port_has_them_lower_the_confidence():
    image, masks = drawn(POSES[1])
    doubts = [1 - verify.confidence(evidence(POSES[1], image, masks, 3.0, off_px)) for off_px in (0, 1, 4)]
    assert doubts[0] < doubts[1] < doubts[2] and doubts[2] > 10 * doubts[0]


def test_confidence_is_a_probability():
    rng = np.random.default_rng(0)
    values = verify.confidence(50 * rng.standard_normal((200, 6)))
    assert values.shape == (200,) and np.all((values >= 0) & (values <= 1))


def test_what_is_hidden_lies_behind_plate_or_petals():
    """From the axis nothing of the ring; from 60 deg aside, its far side and not its near side."""
    angle = np.linspace(0, 2 * np.pi, 72, endpoint=False)
    ring_m = PORT.ring_radius_m * np.stack([np.cos(angle), np.sin(angle), 0 * angle], -1)
    assert not verify.hidden(ring_m, [0, 0, 0.6], PORT).any()
    for azimuth in (0.0, 0.7, 2.0):
        aside = np.array([np.cos(azimuth) * np.sin(np.pi / 3), np.sin(azimuth) * np.sin(np.pi / 3), 0.5])
        behind = verify.hidden(ring_m, 0.6 * aside, PORT)
        toward = np.cos(angle - azimuth)
        assert behind[toward < -0.9].mean() > 0.5
        assert not behind[toward > 0].any()
    assert verify.hidden(np.zeros((1, 3)), [0, 0, 0.6], PORT).all()  # the plate hides the stem's foot
