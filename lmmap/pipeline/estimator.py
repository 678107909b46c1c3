"""The pose of the port in one image: filter, skeleton, ellipse, two circles, yaw."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from ..geometry.projection import undistort_points
from ..refinement import contour, image_edges, joint, uncertainty, verify
from ..refinement.contour import Contour
from ..settings import OURS, Settings
from ..types import Ellipse, Estimate, Port, Pose, Status, check_time
from . import agreement, circle, ellipse, local_search, outline, yaw
from .follow import Expected, at_once, follow, mask_within
from .image_estimator import ImageEstimator, Weights
from .inputs import AnyCamera
from .network import TurnedToo
from .rescale import enlarged_cameras
from .ring import skeleton_points


class Estimator(ImageEstimator):
    """Pose of the port in one image.

    Parameters
    ----------
    camera, port
        Default: the bench's DAVIS 346 and the LM-MAP.  A camera may be the path of its calibration.
    modality
        ``"rgb"``: images (H, W, 3) u8.  ``"event"``: histograms (H, W) of event counts.
    weights
        The two mask networks: one of the shipped sets, `DOMAIN_GAPS`, a folder with files named as the
        low-domain-gap ones, or the two as callables ``(ring, reflectors)``, each from an image to a mask
        (H, W) in [0, 1].  Default: ``OURS.weights``, the set that the command line takes as well.
    settings
        Default: `OURS`, its number of events kept per pixel of this camera.
    precision
        Of the shipped networks; ``"auto"`` takes bfloat16 where the processor has it, ``"float32"`` never.

    Attributes
    ----------
    grid : Camera
        The camera in whose pixels masks and geometry are: ``camera``, or its images at the focal length that
        the networks know (`rescale`).  Methods take these pixels; a call takes the camera's.
    """

    def __init__(self, camera: AnyCamera = None, port: Port | None = None, modality: str = "rgb",
                 weights: Weights = OURS.weights, settings: Settings | None = None,
                 precision: str = "auto"):  # fmt: skip
        super().__init__(camera, port, modality, weights, settings, precision)
        self._enlarged = [
            self._with(grid=grid) for grid in enlarged_cameras(self.camera, modality, self.settings)
        ]
        self._turned = []
        if self.settings.turned_look:
            ring, reflectors = TurnedToo(self.ring_network), TurnedToo(self.reflector_network)
            self._turned = [self._with(ring_network=ring, reflector_network=reflectors)]

    def _with(self, **attributes) -> Estimator:
        """An estimator of one look, like this one but for some attributes."""
        other = copy(self)
        vars(other).update(attributes, _enlarged=[], _turned=[])
        return other

    def __call__(self, image: np.ndarray, t_us: int = 0, near: Expected | None = None) -> Estimate:
        """As `ImageEstimator`; a ring that is expected (``near``, in pixels of `grid`) is looked for there
        alone, and ``printed`` is left out.  An image whose ring is seen without a sure pose is looked at with
        its half turn as well.  Of a small sensor's histogram without a pose, larger ones are looked at."""
        check_time("t_us", t_us)
        estimate = self.in_camera(self.on_grid(self.to_grid(image), t_us, near))
        if near is not None:
            return estimate
        if self._turned and agreement.in_doubt(estimate, self.settings):
            estimate = self.together([estimate, *(look(image, t_us) for look in self._turned)])
        if estimate.T_cam_port is None:
            looks = (look(image, t_us) for look in self._enlarged)
            estimate = next((look for look in looks if look.T_cam_port is not None), estimate)
        return estimate

    def together(self, estimates: Sequence[Estimate]) -> Estimate:
        """The answer of several looks at one image, as `agreement.together`."""
        return agreement.together(estimates, self.modality, self.port, self.settings)

    def on_grid(self, image: np.ndarray, t_us: int = 0, near: Expected | None = None) -> Estimate:
        """The estimate of an image in the pixels of `grid`, its ellipse in these as well."""
        if near:
            ring_mask, (reflectors, edges) = at_once(
                lambda: mask_within(self.ring_network, image, *near.ring),
                lambda: (mask_within(self.reflector_network, image, *near.markers), outline.edges(image)),
            )
        else:
            ring_mask, edges = self.ring_network(image), outline.edges(image)
        ring, coverage = self.find_ring(ring_mask, near)
        if not isinstance(ring, Contour):
            return Estimate(t_us, ring)
        fitted, radius_m = ring.ellipse, self.port.ring_radius_m
        candidates = circle.poses(fitted, self.grid, radius_m) if near else self.candidates(fitted)
        if near is None or not near.markers.holds(self.markers_box(candidates)):
            reflectors = self.find_reflectors(image, candidates)
        best = yaw.fast_yaw(reflectors, candidates[:2], self.port, self.grid, self.settings, edges,
                            self.settings.yaw_weights[self.modality])  # fmt: skip
        if best.score < self.settings.min_marker_score:
            unknown_rad = self.port.yaw_period_rad / np.sqrt(12)
            known = self.ring_uncertainty(candidates[0], ring, unknown_rad)
            return Estimate(t_us, Status.NO_MARKERS, ring=candidates[0], twin=candidates[1], ellipse=fitted,
                            arc_coverage=coverage, marker_score=best.score,
                            covariance=known.covariance)  # fmt: skip
        printed = None
        if near is None:
            printed = yaw.fast_yaw(reflectors, candidates[2:], self.port, self.grid, self.settings).T_cam_port
        T_by_masks, by_masks, tilt_sigmas = self.refine(best, ring, reflectors)
        T_cam_port, covariance = self.refine_on_edges(T_by_masks, by_masks, best, edges)
        confidence = self.confidence(T_cam_port, by_masks, best, image, ring_mask, reflectors)
        estimate = Estimate(t_us, Status.OK, T_cam_port, best.rival, printed, fitted, coverage, best.score,
                            best.rival_score, best.margin, tilt_sigmas, covariance)  # fmt: skip
        return agreement.report(estimate, confidence, self.settings.min_confidence[self.modality])

    def confidence(self, T_cam_port: Pose, covariance, best: yaw.YawFit, *images) -> float:
        """Probability that a pose is right, by its covariance (6, 6) as the masks have it, its yaw's fit, and
        by the image, the ring's mask and the reflectors' mask (H, W)."""
        evidence = verify.evidence(
            T_cam_port, covariance, best.sigma_rad, best.log_odds, *images, self.port, self.grid
        )
        return float(verify.confidence(evidence, self.settings))

    def refine(self, best: yaw.YawFit, ring: Contour, reflectors: np.ndarray):
        """Pose with its covariance (6, 6), refined on ring and markers where the settings allow it and yaw
        and enough of the markers' edges are known; and the ring's distance from head-on, in standard
        deviations."""
        known, sigma_px = self.ring_uncertainty(best.T_cam_port, ring, best.sigma_rad), self.sigma_px(ring)
        if self.settings.refine_jointly and best.yaw_margin >= self.settings.min_yaw_margin:
            marker_sigma_px = self.settings.marker_sigma_px[self.modality]
            both = joint.refine(best.T_cam_port, ring.points_px, reflectors, self.port, self.grid, sigma_px,
                                marker_sigma_px, self.settings)  # fmt: skip
            if both is not None:
                covariance = joint.inflate(
                    both.covariance, best.score, self.settings.joint_inflation[self.modality]
                )
                return both.T_cam_port, covariance, known.tilt_sigmas
        return best.T_cam_port, known.covariance, known.tilt_sigmas

    def refine_on_edges(self, T_cam_port: Pose, covariance, best: yaw.YawFit, edges):
        """A pose by the masks and its covariance (6, 6), refined on the image's `outline.edges` (H, W) where
        the settings allow it and the yaw is known."""
        if not self.settings.edge_rounds or best.yaw_margin < self.settings.min_yaw_margin:
            return T_cam_port, covariance
        T_cam_port, covariance = image_edges.refine(
            T_cam_port, covariance, edges, self.port, self.grid, self.settings
        )
        inflation, fading = (
            getattr(self.settings, name)[self.modality] for name in ("edge_inflation", "edge_fading")
        )
        return T_cam_port, joint.inflate(covariance, best.score, inflation, fading)

    def sigma_px(self, ring: Contour) -> float:
        """Standard deviation of a contour's point, as if all were independent: as 1 / score of the mask."""
        inflation = self.settings.ring_inflation[self.modality]
        scatter_px = max(ring.sigma_px, self.settings.min_sigma_px) * np.sqrt(inflation)
        return scatter_px / max(ring.score, self.settings.min_ring_score)

    def ring_uncertainty(self, T_cam_port: Pose, ring: Contour, yaw_sigma_rad: float):
        """`uncertainty.Uncertainty` of a circle's pose by its contour."""
        return uncertainty.pose_uncertainty(
            T_cam_port, ring.points_px, self.sigma_px(ring), self.port.ring_radius_m, self.grid,
            yaw_sigma_rad, self.settings.merged_sigmas,
        )  # fmt: skip

    def find_ring(self, mask: np.ndarray, near: Expected | None = None) -> tuple[Contour | Status, float]:
        """The ring's contour, free of lens distortion, and its arc coverage; or why there is none.

        It is looked for where it is expected, then among the mask's sure blobs, and if they hold none, in all
        of it.
        """
        if near is not None:
            width_px = self.strip_px(near.ellipse)
            if followed := follow(near.ellipse, mask, width_px, self.grid, self.settings):
                return followed
        for peak_share in (self.settings.peak_share, 0.0):
            points = skeleton_points(mask, self.settings.mask_threshold, peak_share)
            if len(points) < self.settings.min_ring_pixels:
                status = Status.NO_RING
                continue
            points = undistort_points(points, self.grid)
            fitted, inliers = self.find_ellipse(points, mask)
            if fitted is not None:
                break
            status = Status.NO_ELLIPSE
        else:
            return status, 0.0
        ring = contour.trace(fitted, mask, self.strip_px(fitted), self.grid, self.settings)
        ring = ring or contour.from_points(fitted, points[inliers])
        ring = replace(ring, score=contour.score(ring.ellipse, mask, self.grid))
        return ring, ellipse.arc_coverage(ring.ellipse, points)

    def strip_px(self, ring: Ellipse) -> float:
        """Half the width of the strip about a ring's ellipse in which its stroke is looked for."""
        p = self.port
        stroke_px = (p.ring_outer_radius_m - p.ring_inner_radius_m) / p.ring_radius_m * ring.semi_axes_px[0]
        return float(self.settings.contour_half_width * stroke_px)

    def find_ellipse(self, points_px, mask: np.ndarray) -> tuple[Ellipse | None, np.ndarray]:
        """The ring's ellipse among a mask's points (M, 2), and which of them lie on it (M,)."""
        fitted, inliers = ellipse.fit_ransac(points_px, np.random.default_rng(0), self.settings)
        if fitted is None and self.settings.local_search:
            rng = np.random.default_rng(0)
            return local_search.fit_local(points_px, mask, rng, self.grid, self.settings)
        return fitted, inliers

    def candidates(self, ring: Ellipse) -> Pose:
        """Poses (4,) that a ring's ellipse leaves open, yaw apart: two exact, two by the paper's formula."""
        both = [f(ring, self.grid, self.port.ring_radius_m) for f in (circle.poses, circle.paper_poses)]
        return Pose(*(np.concatenate([getattr(T, n) for T in both]) for n in ("rotation", "position_m")))
