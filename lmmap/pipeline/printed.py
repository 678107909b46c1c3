"""The paper's own procedure, complete and following only its text; `estimator` is ours."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from ..geometry.conics import is_view
from ..geometry.projection import undistort_points
from ..settings import PAPER, Assumptions, PaperSettings, Settings
from ..types import Camera, Estimate, Port, Status, checked
from .circle import paper_poses
from .ellipse import paper_ransac
from .image_estimator import ImageEstimator, Weights, settings_for
from .inputs import as_camera
from .masks import reflector_mask
from .ring import skeleton_points
from .yaw import paper_yaw


class PrintedEstimator(ImageEstimator):
    """Pose of the port in one image, following the paper's text; called like `Estimator`.

    One threshold, Zhang's skeleton, the count gamma_S, H ellipses through five points each with F = 1 in raw
    pixels, the check of their axes' ratio, and a refit of the best one on its inliers.  Then centre and
    normals by the printed formulas, and the yaw by the largest sum under the drawn markers, for both normals
    at every degree.  No arc is too short and no marker too faint, since the text names no such gate; its
    outlier filter is `tracking.outliers.outlier_filter`.

    The text does not mention lens distortion.  If a camera has some, the skeleton's points are undistorted.

    Parameters
    ----------
    camera, port, modality, weights, settings, precision
        As `Estimator`, but by default with the networks trained like the paper's, the set ``low``.  Of the
        settings, only the number of events is used.
    assumptions
        What the text leaves open.
    paper
        What the text states.

    Examples
    --------
    >>> estimator = lmmap.PrintedEstimator(modality="rgb")
    >>> estimator(np.zeros((260, 346, 3), np.uint8), t_us=8000).status
    <Status.NO_RING: 'no_ring'>
    """

    @checked
    def __init__(
        self,
        camera: Camera | str | Path | None = None,
        port: Port | None = None,
        modality: str = "rgb",
        weights: Weights = "low",
        settings: Settings | None = None,
        precision: str = "auto",
        *,
        assumptions: Assumptions | None = None,
        paper: PaperSettings = PAPER,
    ):
        # for `run`, which cuts the recording into images: N events once, and no second look
        settings = replace(settings or settings_for(as_camera(camera)), second_look_factor=1.0)
        super().__init__(camera, port, modality, weights, settings, precision)
        self.assumptions, self.paper = assumptions or Assumptions(), paper

    def on_grid(self, image: np.ndarray, t_us: int = 0) -> Estimate:
        """Estimate the pose in an image in the pixels of `grid`; the ellipse is in these pixels, too."""
        port, grid, assumed = self.port, self.grid, self.assumptions
        points_px = skeleton_points(self.ring_network(image), assumed.mask_threshold, peak_share=0.0)
        if len(points_px) < assumed.min_ring_pixels:
            return Estimate(t_us, Status.NO_RING)
        ring, _ = paper_ransac(undistort_points(points_px, grid), np.random.default_rng(0), assumed)
        if ring is None or not is_view(ring, grid):
            return Estimate(t_us, Status.NO_ELLIPSE)
        circles = paper_poses(ring, grid, port.ring_radius_m)
        reflectors = reflector_mask(self.reflector_network, image, circles, port, grid)
        fit = paper_yaw(reflectors, circles, port, grid, self.paper)
        return Estimate(t_us, Status.OK, fit.T_cam_port, fit.rival, ellipse=ring, marker_score=fit.score,
                        rival_score=fit.rival_score)  # fmt: skip
