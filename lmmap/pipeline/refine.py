"""The pose of ring and markers, refined on both masks and then on the image's edges, and its covariance."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..refinement import image_edges, joint
from ..refinement.contour import Contour, Edge
from ..refinement.uncertainty import Uncertainty, pose_uncertainty
from ..types import Pose
from .masks import Seen
from .setup import Setup
from .yaw import YawFit


@dataclass(frozen=True)
class Refined:
    """A pose with its covariance (6, 6), conventions of `uncertainty`, given the port's tolerances.

    ``covariance_by_masks`` is the covariance before the image's edges were used, ``tilt_sigmas`` the ring's
    tilt away from head-on in units of its own standard deviation, and ``markers_off_px`` the distance of the
    markers from where the port's geometry puts them.
    """

    T_cam_port: Pose
    covariance: np.ndarray
    covariance_by_masks: np.ndarray
    tilt_sigmas: float
    markers_off_px: float


def refine(fit: YawFit, ring: Contour, seen: Seen, setup: Setup) -> Refined:
    """Refine a pose on masks and image, as far as the settings allow it and its yaw is known."""
    assert seen.reflectors is not None  # once circles are known
    port, camera, modality, settings = setup.port, setup.camera, setup.modality, setup.settings
    T, off, by_masks, tilt_sigmas = on_masks(fit, ring, seen.reflectors, setup)
    (higher, further), covariance = off, by_masks
    if settings.edge_rounds and fit.yaw_margin >= settings.min_yaw_margin:
        T, higher, covariance = image_edges.refine(T, higher, covariance, seen.edges, port, camera, settings)
        inflation, fading = settings.edge_inflation[modality], settings.edge_fading[modality]
        covariance = joint.inflate(covariance, fit.score, inflation, fading)
    off_px = joint.markers_off_px(T, (higher, further), port, camera)
    return Refined(T, covariance[:6, :6], by_masks[:6, :6], tilt_sigmas, off_px)


def on_masks(
    fit: YawFit, ring: Contour, reflectors: np.ndarray, setup: Setup
) -> tuple[Pose, np.ndarray, np.ndarray, float]:
    """Pose, deviation of the port and covariance (7, 7) as in `joint.JointFit`, from ring and markers if
    enough of the markers' edges are seen, else from the ring; and the tilt, in standard deviations."""
    known, settings = ring_uncertainty(fit.T_cam_port, ring, fit.sigma_rad, setup), setup.settings
    if settings.refine_jointly and fit.yaw_margin >= settings.min_yaw_margin:
        both = joint.refine(fit.T_cam_port, ring_edges(ring, setup), reflectors, setup.port, setup.camera,
                            settings.marker_sigma_px[setup.modality], settings)  # fmt: skip
        if both is not None:
            inflation = settings.joint_inflation[setup.modality]
            covariance = joint.inflate(both.covariance, fit.score, inflation)
            return both.T_cam_port, both.port_off, covariance, known.tilt_sigmas
    covariance = np.eye(7)
    covariance[:6, :6] = known.covariance
    return fit.T_cam_port, np.zeros(2), covariance, known.tilt_sigmas


def ring_uncertainty(T_cam_port: Pose, ring: Contour, yaw_sigma_rad: float, setup: Setup) -> Uncertainty:
    """Uncertainty of a circle's pose, given its contour."""
    return pose_uncertainty(T_cam_port, ring.points_px, sigma_px(ring, setup), setup.port.ring_radius_m,
                            setup.camera, yaw_sigma_rad, setup.settings.merged_sigmas)  # fmt: skip


def sigma_px(ring: Contour, setup: Setup, scatter_px=None):
    """Standard deviation (px) of a contour's point, or of others by their scatter, as if all were
    independent; it is proportional to 1 / score of the mask."""
    s = setup.settings
    scatter_px = np.maximum(ring.sigma_px if scatter_px is None else scatter_px, s.min_sigma_px)
    return scatter_px * np.sqrt(s.ring_inflation[setup.modality]) / max(ring.score, s.min_ring_score)


def ring_edges(ring: Contour, setup: Setup) -> list[joint.RingEdge]:
    """The ring's edges as circles of their own radii, or its centre line if the two cannot be separated."""
    port = setup.port
    circles: Iterable[tuple[Edge, float, int]]
    circles = [(Edge(ring.points_px, np.full(len(ring.points_px), ring.sigma_px)), port.ring_radius_m, 0)]
    if ring.edges:
        circles = zip(ring.edges, (port.ring_inner_radius_m, port.ring_outer_radius_m), (-1, 1), strict=True)
    return [joint.RingEdge(edge.points_px, sigma_px(ring, setup, edge.sigma_px), radius_m, side)
            for edge, radius_m, side in circles]  # fmt: skip
