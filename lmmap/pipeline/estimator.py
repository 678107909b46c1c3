"""The pose of the port in one image: filter, skeleton, ellipse, two circles, yaw."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..settings import OURS, Settings
from ..types import Camera, Estimate, Port, Status, check_time
from . import agreement, circle
from .crops import mask_about
from .image_estimator import ImageEstimator, Weights
from .judge import judge, without_markers
from .masks import Expected, look, markers_box_px
from .network import TurnedToo
from .refine import refine
from .rescale import enlarged_cameras
from .ring import find_ring
from .yaw import fast_yaw


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

    def __init__(self, camera: Camera | str | Path | None = None, port: Port | None = None,
                 modality: str = "rgb", weights: Weights = OURS.weights, settings: Settings | None = None,
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
        if near is not None and not isinstance(near, Expected):
            raise ValueError(f"near: expected the place that masks.Expected says, got {near!r:.40}")
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
        port, grid, modality, settings = self.port, self.grid, self.modality, self.settings
        seen = look(image, self.ring_network, self.reflector_network, near)
        ring = find_ring(seen.ring, port, grid, settings, near and near.ellipse)
        if isinstance(ring, Status):
            return Estimate(t_us, ring)
        circles = (circle.poses if near else circle.candidates)(ring.ellipse, grid, port.ring_radius_m)
        box = markers_box_px(circles, port, grid, settings.marker_border_px)
        seen_there = near and near.markers.holds(box)
        reflectors = seen.reflectors if seen_there else mask_about(self.reflector_network, image, *box)
        weights = settings.yaw_weights[modality]
        fit = fast_yaw(reflectors, circles[:2], port, grid, settings, seen.edges, weights)
        if fit.score < settings.min_marker_score:
            return without_markers(t_us, circles, ring, fit.score, port, grid, modality, settings)
        refined = refine(fit, ring, reflectors, seen.edges, port, grid, modality, settings)
        estimate = judge(t_us, image, seen, reflectors, ring, fit, refined, port, grid, modality, settings)
        if near:
            return estimate
        return replace(estimate, printed=fast_yaw(reflectors, circles[2:], port, grid, settings).T_cam_port)
