"""How well a circle's pose is known: covariances through a chart of cones.

A covariance (6, 6) is of (dx, dy, dz, rx, ry, rz) in metres and radians, all along the camera's axes:
the true pose is p = p_hat + (dx, dy, dz) and R = exp([r]x) R_hat (a left perturbation of T_cam_port's
rotation; position and rotation apart, not a twist).

Head-on, the pose is a poor parametrisation: the two solutions merge and their Jacobian loses rank.  The
cone of lines of sight is a good one everywhere.  With eigenvalues l1 >= l2 > 0 > l3, eigenvectors e1,
e2, e3 and m = (l1 + l2) / 2, its chart is (y1, y2, s, w1, w2): the axis e3 turned toward e1 and e2,
s = log(m / -l3) / 2, and w = (l1 - l2) / (m - l3) as a vector at twice its azimuth about e3, so that
sin^2(tilt from e3) = |w| / (1 + |w| / 2).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial.hermite_e import hermegauss

from ..geometry.conics import circle_conic, cone
from ..settings import OURS
from ..types import Camera, Pose

NODES, WEIGHTS = hermegauss(9)


@dataclass(frozen=True)
class Uncertainty:
    """Uncertainty of a circle's pose, as `pose_uncertainty` computes it.

    Attributes
    ----------
    chart : (5, 5)
        Covariance of its cone's chart.
    tilt_sigmas : float
        Distance of w from 0, at which the circle is seen head-on, in standard deviations.
    """

    T_cam_port: Pose
    chart: np.ndarray
    tilt_sigmas: float
    radius_m: float
    camera: Camera
    yaw_sigma_rad: float
    merged: float

    @cached_property
    def covariance(self) -> np.ndarray:
        """Covariance (6, 6) of the pose, conventions above: the second moments of its region about the
        estimate.

        Below about 6 sigmas that region is not an ellipse but the chi-square disc of w, and below
        `Settings.merged_sigmas` it is the disc on both branches: so near head-on the variances are large, and
        ``chart`` says more than they do.
        """
        _, E, m, w = cone_chart(self.T_cam_port, self.radius_m, self.camera)
        size, branch = 0.5 * np.log(m), np.sign(-self.T_cam_port.normal @ E[:, 0]) or 1.0

        # quadrature over w; y and s follow by their conditional mean, and add their conditional spread
        chart, radius_m = self.chart, self.radius_m
        z = np.stack(np.meshgrid(NODES, NODES), -1).reshape(-1, 2)
        weights = np.multiply.outer(WEIGHTS, WEIGHTS).ravel() / WEIGHTS.sum() ** 2
        gain = chart[:3, 3:] @ np.linalg.inv(chart[3:, 3:])
        dw = z @ np.linalg.cholesky(chart[3:, 3:]).T
        branches = (branch, -branch) if self.tilt_sigmas < self.merged else (branch,)
        moved = [_move(dw @ gain.T, dw + np.array([w, 0]), size, b, radius_m) for b in branches]
        around, weights = np.concatenate(moved), np.tile(weights, len(branches)) / len(branches)
        rest = chart[:3, :3] - gain @ chart[3:, :3]
        step = 1e-6
        here = _move(np.zeros((1, 3)), np.array([[w, 0]]), size, branch, radius_m)
        J_rest = (_move(step * np.eye(3), np.array([[w, 0]] * 3), size, branch, radius_m) - here) / step
        moments = np.einsum("n,ni,nj->ij", weights, around - here, around - here) + J_rest.T @ rest @ J_rest

        # to the camera's axes: position, and the rotation n x dn that turns the normal by dn
        n = self.T_cam_port.normal
        cross = np.cross(np.eye(3), n)  # [n]x
        to_camera = np.zeros((6, 6))
        to_camera[:3, :3], to_camera[3:, 3:] = E, -cross @ E  # the chart's normal points away
        covariance = to_camera @ moments @ to_camera.T
        covariance[3:, 3:] += self.yaw_sigma_rad**2 * np.outer(n, n)
        return (covariance + covariance.T) / 2


def information(T_cam_port: Pose, points_px, radius_m: float, camera: Camera) -> np.ndarray:
    """Fisher information (5, 5) of undistorted contour points (M, 2) about the chart of a circle's cone,
    for independent noise of 1 px across the contour; its inverse is the Cramer-Rao bound.

    A change dQ of the cone moves the contour by x' dQ x / |grad x' Q x|.
    """
    return _information(*cone_chart(T_cam_port, radius_m, camera), points_px, camera)


def _information(eigenvalues, E, m, w, points_px, camera: Camera) -> np.ndarray:
    l1, l2, l3 = eigenvalues
    sights = np.column_stack([points_px, np.ones(len(points_px))]) @ camera.K_inverse.T
    a, b, c = (sights @ E).T
    gap = m - l3
    # dQ of a unit step along y1, y2, s, w1, w2, in the eigenvectors' axes, as x' dQ x: turning e3 toward e1
    # gives (l3 - l1)(e1 e3' + e3 e1'), scaling 2 m (1 + w/2, 1 - w/2, 0), and w (m - l3)/2 (1, -1, 0)
    change = np.stack(
        [
            2 * (l3 - l1) * a * c,
            2 * (l3 - l2) * b * c,
            2 * m * (a * a * (1 + w / 2) + b * b * (1 - w / 2)),
            gap / 2 * (a * a - b * b),
            gap * a * b,
        ],
        -1,
    )
    gradient = 2 * np.stack([l1 * a, l2 * b, l3 * c], -1) @ E.T[:, :2]
    slope = np.linalg.norm(gradient / [camera.fx_px, camera.fy_px], axis=-1)
    J = change / slope[..., None]
    return J.T @ J


def pose_uncertainty(T_cam_port: Pose, points_px, sigma_px: float, radius_m: float, camera: Camera,
                     yaw_sigma_rad=0.0, merged=OURS.merged_sigmas) -> Uncertainty:  # fmt: skip
    """Uncertainty of an exact circle pose whose ellipse was fitted to contour points (M, 2) px.

    Parameters
    ----------
    sigma_px : standard deviation of a contour point, as if all were independent
    yaw_sigma_rad : of the rotation about the normal
    merged : below this many sigmas of tilt the other branch belongs to the region; 0 if the branch is known

    Raises
    ------
    ValueError
        If fewer than five points, or points in fewer than five places, determine no ellipse.
    """
    axes = cone_chart(T_cam_port, radius_m, camera)
    J = _information(*axes, points_px, camera)
    least, *_, most = np.linalg.eigvalsh(J)
    if len(points_px) < 5 or not most < 1e14 * least:
        raise ValueError(f"points_px: expected points that determine an ellipse, got {len(points_px)}")
    chart = np.linalg.inv(J) * sigma_px**2
    tilt_sigmas = float(np.linalg.norm(np.linalg.solve(np.linalg.cholesky(chart[3:, 3:]), [axes[-1], 0])))
    return Uncertainty(T_cam_port, chart, tilt_sigmas, radius_m, camera, yaw_sigma_rad, merged)


def cone_chart(
    T_cam_port: Pose, radius_m: float, camera: Camera
) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Eigenvalues scaled to l3 = -1, axes, m and |w| of a circle's cone; raises ValueError for a radius that
    is not positive, or a circle that is not in front of the camera."""
    if not radius_m > 0:
        raise ValueError(f"radius_m: expected a positive number, got {radius_m}")
    eigenvalues, E = cone(circle_conic(T_cam_port, radius_m, camera), camera.K)
    eigenvalues = eigenvalues / -eigenvalues[2]
    near = radius_m * np.sqrt(max(1 - T_cam_port.normal[2] ** 2, 0))  # half the circle's extent in depth
    if not (T_cam_port.position_m[2] > near and eigenvalues[1] > 0):
        raise ValueError(f"T_cam_port: expected a circle ahead of the camera, got {T_cam_port.position_m} m")
    m = (eigenvalues[0] + eigenvalues[1]) / 2
    return eigenvalues, E, m, (eigenvalues[0] - eigenvalues[1]) / (m + 1)


def _move(dys, w, size: float, branch: float, radius_m: float) -> np.ndarray:
    """Position and outward normal (N, 6), in the estimate's axes, of cones at (y1, y2, s) steps dys
    (N, 3) and vectors w (N, 2), on the branch nearest to the estimate's."""
    # the chart's definitions solved for the cone, then the exact pose of `circle.poses`
    m, length = np.exp(2 * (size + dys[:, 2])), np.hypot(*w.T)
    l1, azimuth = m + (m + 1) * length / 2, np.arctan2(w[:, 1], w[:, 0]) / 2
    sine = np.sqrt(length / (1 + length / 2))
    cosine = np.sqrt(np.maximum(1 - sine**2, 0))
    along = np.stack([branch * np.cos(azimuth), branch * np.sin(azimuth)], -1)
    n = np.column_stack([sine[:, None] * along, cosine])
    p = radius_m * np.column_stack([-(sine / np.sqrt(l1))[:, None] * along, np.sqrt(l1) * cosine])
    turn = np.column_stack([-dys[:, 1], dys[:, 0], np.zeros(len(w))])
    return np.column_stack([_rotate(turn, p), _rotate(turn, n)])


def _rotate(turn, v):
    """Rodrigues' formula, (N, 3) x (N, 3)."""
    angle = np.linalg.norm(turn, axis=1, keepdims=True)
    axis = turn / np.maximum(angle, 1e-300)
    dot = np.sum(axis * v, 1, keepdims=True)
    return v * np.cos(angle) + np.cross(axis, v) * np.sin(angle) + axis * dot * (1 - np.cos(angle))
