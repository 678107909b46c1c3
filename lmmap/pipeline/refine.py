"""The pose of ring and markers, sharpened on both masks and then on the image's edges, and how well it is
known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..refinement import image_edges, joint
from ..refinement.contour import Contour
from ..refinement.uncertainty import Uncertainty, pose_uncertainty
from ..settings import OURS, Settings
from ..types import Camera, Port, Pose
from .yaw import YawFit


@dataclass(frozen=True)
class Refined:
    """A pose with its covariance (6, 6), conventions of `uncertainty`.

    ``covariance_by_masks`` is that before the image's edges took part, and ``tilt_sigmas`` the ring's
    distance from head-on, in its own standard deviations.
    """

    T_cam_port: Pose
    covariance: np.ndarray
    covariance_by_masks: np.ndarray
    tilt_sigmas: float
    off: np.ndarray


def refine(fit: YawFit, ring: Contour, reflectors: np.ndarray, edges: np.ndarray, port: Port, camera: Camera,
           modality: str, settings: Settings = OURS) -> Refined:  # fmt: skip
    """A pose refined on masks and image, as far as the settings allow it and its yaw is known.

    Parameters
    ----------
    reflectors, edges : (H, W)
        The reflector mask, and the image's `outline.edges`.
    """
    T, off, by_masks, tilt_sigmas = on_masks(fit, ring, reflectors, port, camera, modality, settings)
    covariance = by_masks
    if settings.edge_rounds and fit.yaw_margin >= settings.min_yaw_margin:
        T, higher, covariance = image_edges.refine(T, off[0], covariance, edges, port, camera, settings)
        off = np.array([higher, off[1]])
        inflation, fading = settings.edge_inflation[modality], settings.edge_fading[modality]
        covariance = joint.inflate(covariance, fit.score, inflation, fading)
    return Refined(T, covariance[:6, :6], by_masks[:6, :6], tilt_sigmas, off)


def on_masks(fit: YawFit, ring: Contour, reflectors: np.ndarray, port: Port, camera: Camera, modality: str,
             settings: Settings = OURS) -> tuple[Pose, np.ndarray, np.ndarray, float]:  # fmt: skip
    """What `joint.JointFit` says of a pose, by ring and markers, where enough of the markers' edges are known,
    else by the ring alone; and the ring's distance from head-on, in standard deviations."""
    known = ring_uncertainty(fit.T_cam_port, ring, fit.sigma_rad, port, camera, modality, settings)
    if settings.refine_jointly and fit.yaw_margin >= settings.min_yaw_margin:
        both = joint.refine(fit.T_cam_port, ring_edges(ring, port, modality, settings), reflectors, port, camera,
                            settings.marker_sigma_px[modality], settings)
        if both is not None:
            covariance = joint.inflate(both.covariance, fit.score, settings.joint_inflation[modality])
            return both.T_cam_port, both.off, covariance, known.tilt_sigmas
    covariance = np.eye(7)
    covariance[:6, :6] = known.covariance
    return fit.T_cam_port, np.zeros(2), covariance, known.tilt_sigmas


def ring_uncertainty(T_cam_port: Pose, ring: Contour, yaw_sigma_rad: float, port: Port, camera: Camera,
                     modality: str, settings: Settings = OURS) -> Uncertainty:  # fmt: skip
    """How well a circle's pose is known by its contour."""
    scatter_px = sigma_px(ring, modality, settings)
    return pose_uncertainty(T_cam_port, ring.points_px, scatter_px, port.ring_radius_m, camera, yaw_sigma_rad,
                            settings.merged_sigmas)  # fmt: skip


def sigma_px(ring: Contour, modality: str, settings: Settings = OURS) -> float:
    """Standard deviation of a contour's point, as if all were independent: as 1 / score of the mask."""
    return _inflated(ring.sigma_px, ring.score, modality, settings)


def ring_edges(ring: Contour, port: Port, modality: str, settings: Settings = OURS) -> list[joint.RingEdge]:
    """The ring's edges as circles of their own radii; its middle where they are not known apart."""
    seen = [(edge.points_px, edge.sigma_px) for edge in ring.edges] or [(ring.points_px, np.full(len(ring.points_px), ring.sigma_px))]
    radii_m = (port.ring_inner_radius_m, port.ring_outer_radius_m) if ring.edges else (port.ring_radius_m,)
    sides = (-1, 1) if ring.edges else (0,)
    return [joint.RingEdge(points, _inflated(scatter, ring.score, modality, settings), radius, side)
            for (points, scatter), radius, side in zip(seen, radii_m, sides, strict=True)]


def _inflated(scatter_px: float, score: float, modality: str, settings: Settings) -> float:
    scatter_px = np.maximum(scatter_px, settings.min_sigma_px) * np.sqrt(settings.ring_inflation[modality])
    return scatter_px / max(score, settings.min_ring_score)
