"""The pose of ring and markers, sharpened on both masks and then on the image's edges, and how well it is
known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..refinement import image_edges, joint
from ..refinement.contour import Contour, Edge
from ..refinement.uncertainty import Uncertainty, pose_uncertainty
from ..settings import OURS, Settings
from ..types import Camera, Port, Pose
from .yaw import YawFit


@dataclass(frozen=True)
class Refined:
    """A pose with its covariance (6, 6), conventions of `uncertainty`, within the port's tolerances.

    ``covariance_by_masks`` is that before the image's edges took part, ``tilt_sigmas`` the ring's distance
    from head-on, in its own standard deviations, and ``markers_off_px`` how far the markers are from where
    the port has them.
    """

    T_cam_port: Pose
    covariance: np.ndarray
    covariance_by_masks: np.ndarray
    tilt_sigmas: float
    markers_off_px: float


def refine(fit: YawFit, ring: Contour, reflectors: np.ndarray, edges: np.ndarray, port: Port, camera: Camera,
           modality: str, settings: Settings = OURS) -> Refined:  # fmt: skip
    """A pose refined on masks and image, as far as the settings allow it and its yaw is known.

    Parameters
    ----------
    reflectors, edges : (H, W)
        The reflector mask, and the image's `outline.edges`.
    """
    T, off, by_masks, tilt_sigmas = on_masks(fit, ring, reflectors, port, camera, modality, settings)
    (higher, further), covariance = off, by_masks
    if settings.edge_rounds and fit.yaw_margin >= settings.min_yaw_margin:
        T, higher, covariance = image_edges.refine(T, higher, covariance, edges, port, camera, settings)
        inflation, fading = settings.edge_inflation[modality], settings.edge_fading[modality]
        covariance = joint.inflate(covariance, fit.score, inflation, fading)
    off_px = joint.markers_off_px(T, (higher, further), port, camera)
    return Refined(T, covariance[:6, :6], by_masks[:6, :6], tilt_sigmas, off_px)


def on_masks(fit: YawFit, ring: Contour, reflectors: np.ndarray, port: Port, camera: Camera, modality: str,
             settings: Settings = OURS) -> tuple[Pose, np.ndarray, np.ndarray, float]:  # fmt: skip
    """Pose, how far the port is off, and covariance (7, 7), as `joint.JointFit` has them, by ring and markers
    where enough of the markers' edges are known, else by the ring; and its tilt, in standard deviations."""
    known = ring_uncertainty(fit.T_cam_port, ring, fit.sigma_rad, port, camera, modality, settings)
    if settings.refine_jointly and fit.yaw_margin >= settings.min_yaw_margin:
        both = joint.refine(fit.T_cam_port, ring_edges(ring, port, modality, settings), reflectors, port,
                            camera, settings.marker_sigma_px[modality], settings)  # fmt: skip
        if both is not None:
            covariance = joint.inflate(both.covariance, fit.score, settings.joint_inflation[modality])
            return both.T_cam_port, both.port_off, covariance, known.tilt_sigmas
    covariance = np.eye(7)
    covariance[:6, :6] = known.covariance
    return fit.T_cam_port, np.zeros(2), covariance, known.tilt_sigmas


def ring_uncertainty(T_cam_port: Pose, ring: Contour, yaw_sigma_rad: float, port: Port, camera: Camera,
                     modality: str, settings: Settings = OURS) -> Uncertainty:  # fmt: skip
    """How well a circle's pose is known by its contour."""
    scatter_px = sigma_px(ring, modality, settings)
    return pose_uncertainty(T_cam_port, ring.points_px, scatter_px, port.ring_radius_m, camera, yaw_sigma_rad,
                            settings.merged_sigmas)  # fmt: skip


def sigma_px(ring: Contour, modality: str, settings: Settings = OURS, scatter_px=None):
    """Standard deviation of a contour's point, or of others by their scatter, as if all were independent: as
    1 / score of the mask."""
    scatter_px = np.maximum(ring.sigma_px if scatter_px is None else scatter_px, settings.min_sigma_px)
    return scatter_px * np.sqrt(settings.ring_inflation[modality]) / max(ring.score, settings.min_ring_score)


def ring_edges(ring: Contour, port: Port, modality: str, settings: Settings = OURS) -> list[joint.RingEdge]:
    """The ring's edges as circles of their own radii; its middle line where they are not known apart."""
    circles = [(Edge(ring.points_px, np.full(len(ring.points_px), ring.sigma_px)), port.ring_radius_m, 0)]
    if ring.edges:
        circles = zip(ring.edges, (port.ring_inner_radius_m, port.ring_outer_radius_m), (-1, 1), strict=True)
    return [joint.RingEdge(edge.points_px, sigma_px(ring, modality, settings, edge.sigma_px), radius_m, side)
            for edge, radius_m, side in circles]  # fmt: skip
