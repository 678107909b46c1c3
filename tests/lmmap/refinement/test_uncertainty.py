"""Covariances: calibrated at every tilt, invariant, honest head-on."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from strategies import CAMERA, pose, visible_poses

from lmmap.geometry import conics, rotations
from lmmap.pipeline import circle, ellipse
from lmmap.refinement import uncertainty
from lmmap.settings import OURS
from lmmap.types import Camera, Pose

NU, SIGMA_PX = 0.08, 0.5


def known(T, count=250, sigma_px=SIGMA_PX, **options):
    points = conics.circle_ellipse(T, NU, CAMERA).points(count)
    return uncertainty.pose_uncertainty(T, points, sigma_px, NU, CAMERA, **options)


@pytest.mark.parametrize("tilt_deg", [0, 2, 5, 15, 45])
def test_the_covariance_holds_the_pose_too(tilt_deg):
    """Five degrees of freedom in the pose itself; head-on wide, never too narrow."""
    rng, inside = np.random.default_rng(1), []
    T = pose((200, 110), 0.6, np.deg2rad(tilt_deg), 0.7)
    points = conics.circle_ellipse(T, NU, CAMERA).points(250)
    for _ in range(150):
        e = ellipse.fit(points + SIGMA_PX * rng.standard_normal(points.shape))
        pair = circle.poses(e, CAMERA, NU)
        nearest = pair[int(np.argmax(pair.normal @ T.normal))]
        u = uncertainty.pose_uncertainty(nearest, e.points(250), SIGMA_PX, NU, CAMERA, yaw_sigma_rad=1e-3)
        turn = np.cross(nearest.normal, T.normal)  # small, and without yaw
        d = np.concatenate([T.position_m - nearest.position_m, turn])
        inside.append(d @ np.linalg.solve(u.covariance, d) < chi2.ppf(0.95, 5))
    assert 0.90 <= np.mean(inside) <= 0.99


@given(visible_poses(min_tilt_deg=15, max_tilt_deg=60))
def test_far_from_head_on_it_is_the_jacobians(T):
    """Central differences of `circle.poses`' inverse, the projection, give the same information."""
    points = conics.circle_ellipse(T, NU, CAMERA).points(100)

    def displaced(step):
        turned = Pose(Rotation.from_rotvec(step[3:]).as_matrix() @ T.rotation, T.position_m + step[:3])
        C = conics.circle_conic(turned, NU, CAMERA)
        x = np.column_stack([points, np.ones(len(points))])
        return np.sum(x @ C * x, 1) / (2 * np.linalg.norm((x @ C)[:, :2], axis=1))

    axes = (
        Rotation.align_vectors([T.normal], [[0, 0, 1]])[0].as_matrix()[:, :2]
        if T.normal[2] > -1
        else np.eye(3)
    )
    basis = np.zeros((6, 5))
    basis[:3, :3], basis[3:, 3:] = np.eye(3), axes[:, :2]
    h = 1e-6
    J = np.stack([(displaced(h * b) - displaced(-h * b)) / (2 * h) for b in basis.T], -1)
    expected = basis @ np.linalg.inv(J.T @ J) @ basis.T * 1e-4
    got = uncertainty.pose_uncertainty(T, points, 0.01, NU, CAMERA).covariance
    scale = np.sqrt(expected.diagonal().max()) * np.sqrt(got.diagonal().max())
    np.testing.assert_allclose(got / scale, expected / scale, atol=5e-3)


@settings(max_examples=30)
@given(visible_poses(), st.floats(0, 0.2))
def test_it_is_a_covariance_and_yaw_adds_only_about_the_normal(T, yaw_sigma_rad):
    without, with_yaw = known(T).covariance, known(T, yaw_sigma_rad=yaw_sigma_rad).covariance
    assert np.all(np.linalg.eigvalsh(with_yaw) > -1e-12)
    added = np.zeros((6, 6))
    added[3:, 3:] = yaw_sigma_rad**2 * np.outer(T.normal, T.normal)
    np.testing.assert_allclose(with_yaw - without, added, atol=1e-12)
    assert T.normal @ without[3:, 3:] @ T.normal == pytest.approx(0, abs=1e-12)


@given(visible_poses(min_tilt_deg=1), st.floats(-np.pi, np.pi))
def test_turning_the_camera_about_its_axis_turns_the_covariance(T, turn):
    R = rotations.rotation_z(turn)
    turned = Pose(R @ T.rotation, R @ T.position_m)
    wide = Camera(346, 260, 324.0, 324.0, 172.5, 129.5)
    both = np.kron(np.eye(2), R)
    points = [conics.circle_ellipse(p, NU, wide).points(720) for p in (T, turned)]
    a, b = (
        uncertainty.pose_uncertainty(p, x, 0.3, NU, wide) for p, x in zip((T, turned), points, strict=True)
    )
    scale = np.sqrt(np.outer(b.covariance.diagonal(), b.covariance.diagonal())) + 1e-12
    np.testing.assert_allclose(b.covariance / scale, both @ a.covariance @ both.T / scale, atol=2e-2)


def test_head_on_the_tilt_is_unknown_and_says_so():
    head_on, tilted = known(pose((172.5, 129.5), 0.6, 0.0)), known(pose((172.5, 129.5), 0.6, np.deg2rad(30)))
    assert head_on.tilt_sigmas < OURS.merged_sigmas < 6 < tilted.tilt_sigmas
    rms_deg = [np.rad2deg(np.sqrt(np.trace(u.covariance[3:, 3:]))) for u in (head_on, tilted)]
    assert rms_deg[0] > 3 > 0.5 > rms_deg[1]


def test_misuse_is_named():
    T = pose((172.5, 129.5), 0.6, 0.3)
    points = conics.circle_ellipse(T, NU, CAMERA).points(50)
    with pytest.raises(ValueError, match="points_px: expected"):
        uncertainty.pose_uncertainty(T, points[:4], 0.5, NU, CAMERA)
    with pytest.raises(ValueError, match="points_px: expected"):
        uncertainty.pose_uncertainty(T, points[[0] * 9], 0.5, NU, CAMERA)
    with pytest.raises(ValueError, match="radius_m: expected"):
        uncertainty.pose_uncertainty(T, points, 0.5, 0.0, CAMERA)
    with pytest.raises(ValueError, match="T_cam_port: expected"):
        uncertainty.pose_uncertainty(Pose(T.rotation, -T.position_m), points, 0.5, NU, CAMERA)
    with pytest.raises(ValueError, match="T_cam_port: expected"):
        uncertainty.pose_uncertainty(Pose(T.rotation, [0.0, 0.0, 0.01]), points, 0.5, NU, CAMERA)
