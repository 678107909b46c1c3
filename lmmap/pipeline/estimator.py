"""The pose of the port in one image: filter, skeleton, ellipse, two circles, yaw."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..settings import OURS, Settings
from ..types import Camera, Estimate, Port, Status, check_time
from . import circle
from .crops import mask_about
from .image_estimator import ImageEstimator, Weights, settings_for, within_own_limit
from .judge import judge, without_markers
from .looks import further_looks, look_again
from .masks import Expected, look, markers_box_px
from .refine import refine
from .ring import find_ring
from .weights import before, load_networks
from .yaw import fast_yaw


class Estimator(ImageEstimator):
    """Pose of the port in one image.

    Parameters
    ----------
    camera, port
        Default: the bench's DAVIS 346 and the LM-MAP.  Instead of a camera, give the path of its calibration.
    modality
        ``"rgb"``: images (H, W, 3) u8.  ``"event"``: histograms (H, W) of event counts.
    weights
        The two mask networks: one of the shipped sets, `SETS`, a folder with files named like those of `low`,
        or two callables ``(ring, reflectors)``, each from an image to a mask (H, W) in [0, 1].  Default: the
        command's, ``OURS.weights``.  With a folder of ``lmmap adapt``, the original networks answer first.
    settings
        Default: `OURS`, with the same number of events per pixel of this camera.
    precision
        Precision of the networks; ``"auto"`` uses bfloat16 if the processor multiplies it faster,
        ``"float32"`` never does.

    Attributes
    ----------
    grid : Camera
        The camera in whose pixels masks and geometry are computed: ``camera``, or its images at the focal
        length that the networks know (`rescale`).  Methods take these pixels; a call takes the camera's.
    learned : Estimator or None
        The estimator with the networks that have learned a place.
    further : list of FurtherLook
        Further looks at an image without a sure pose (`looks`).

    Raises
    ------
    ValueError
        If an argument has another type or value.
    InputError
        If the networks or the calibration cannot be read.

    Examples
    --------
    >>> estimator = lmmap.Estimator(modality="rgb")
    >>> estimator(np.zeros((260, 346, 3), np.uint8), t_us=8000).status
    <Status.NO_RING: 'no_ring'>
    """

    def __init__(self, camera: Camera | str | Path | None = None, port: Port | None = None,
                 modality: str = "rgb", weights: Weights = OURS.weights, settings: Settings | None = None,
                 precision: str = "auto"):  # fmt: skip
        first = before(weights, modality)
        super().__init__(camera, port, modality, first or weights, settings, precision)
        self.learned = None
        if first:
            assert isinstance(weights, str | Path)  # of callables none were before
            networks: Any = tuple(load_networks(weights, modality, precision))
            limited = within_own_limit(settings or settings_for(self.camera), weights, modality)
            self.learned = Estimator(self.camera, port, modality, networks, limited)
        self.further = further_looks(self, self.learned)

    def __call__(self, image: np.ndarray, t_us: int = 0, near: Expected | None = None,
                 wider: tuple[int, np.ndarray] | None = None) -> Estimate:  # fmt: skip
        """Estimate the pose in one image, as `ImageEstimator`; if it is not sure, look again (`looks`).

        Parameters
        ----------
        near
            Where the ring is expected, in pixels of `grid`: search only there, and leave out ``printed``.
        wider
            Time (us) and histogram (H, W) of more events, used if a histogram shows no sure pose.

        Raises
        ------
        ValueError
            As `ImageEstimator`.
        """
        check_time("t_us", t_us)
        if near is not None and not isinstance(near, Expected):
            raise ValueError(f"near: expected a masks.Expected, got {near!r:.40}")
        answer = self.in_camera(self.on_grid(self.to_grid(image), t_us, near))
        return look_again(self, answer, image, t_us, near, wider)

    def on_grid(self, image: np.ndarray, t_us: int = 0, near: Expected | None = None) -> Estimate:
        """Estimate the pose in an image in the pixels of `grid`; the ellipse is in these pixels, too."""
        setup = self.setup
        port, grid, settings = setup.port, setup.camera, setup.settings
        seen = look(image, self.ring_network, self.reflector_network, near)
        ring = find_ring(seen.ring, setup, near and near.ellipse)
        if isinstance(ring, Status):
            return Estimate(t_us, ring)
        circles = (circle.poses if near else circle.candidates)(ring.ellipse, grid, port.ring_radius_m)
        box = markers_box_px(circles, port, grid, settings.marker_border_px)
        if seen.reflectors is None or (near and not near.markers.holds(box)):
            seen = seen._replace(reflectors=mask_about(self.reflector_network, image, *box))
        weights = settings.yaw_weights[setup.modality]
        fit = fast_yaw(seen.reflectors, circles[:2], port, grid, settings, seen.edges, weights)
        if fit.score < settings.min_marker_score:
            return without_markers(t_us, circles, ring, fit.score, setup)
        estimate = judge(t_us, image, seen, ring, fit, refine(fit, ring, seen, setup), setup)
        if near:
            return estimate
        printed = fast_yaw(seen.reflectors, circles[2:], port, grid, settings)
        return replace(estimate, printed=printed.T_cam_port)
