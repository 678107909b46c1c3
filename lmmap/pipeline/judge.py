"""The answer for an image: its pose, reported only if masks and image make it probable enough."""

from __future__ import annotations

import numpy as np

from ..refinement import verify
from ..refinement.contour import Contour
from ..types import Estimate, Pose, Status
from .masks import Seen
from .refine import Refined, ring_uncertainty
from .setup import Setup
from .yaw import YawFit


def judge(t_us: int, image: np.ndarray, seen: Seen, ring: Contour, fit: YawFit, refined: Refined,
          setup: Setup) -> Estimate:  # fmt: skip
    """The estimate of a refined pose with its confidence; below the modality's minimum, it is ``unsure``.

    Parameters
    ----------
    image
        Frame (H, W, 3) u8 or histogram (H, W) that both masks in ``seen`` are of.
    """
    estimate = Estimate(
        t_us, Status.OK, refined.T_cam_port, rival=fit.rival, ellipse=ring.ellipse,
        arc_coverage=ring.arc_coverage, marker_score=fit.score, rival_score=fit.rival_score,
        margin=fit.margin, tilt_sigmas=refined.tilt_sigmas, covariance=refined.covariance,
        markers_off_px=refined.markers_off_px,
    )  # fmt: skip
    of_masks = image, seen.ring, seen.reflectors, setup.port, setup.camera
    evidence = verify.evidence(refined.T_cam_port, refined.covariance_by_masks, refined.markers_off_px,
                               fit.log_odds, *of_masks)  # fmt: skip
    confidence = float(verify.confidence(evidence, setup.settings))
    return estimate.judged(confidence, setup.settings.min_confidence[setup.modality])


def without_markers(t_us: int, circles: Pose, ring: Contour, marker_score: float, setup: Setup) -> Estimate:
    """The estimate for a ring whose markers are not seen: two poses (2,) of unknown yaw."""
    unknown_rad = setup.port.yaw_period_rad / np.sqrt(12)
    known = ring_uncertainty(circles[0], ring, unknown_rad, setup)
    return Estimate(t_us, Status.NO_MARKERS, ring=circles[0], twin=circles[1], ellipse=ring.ellipse,
                    arc_coverage=ring.arc_coverage, marker_score=marker_score,
                    covariance=known.covariance)  # fmt: skip
