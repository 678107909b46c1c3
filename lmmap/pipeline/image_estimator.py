"""The base of every estimator: a camera, the port, and the two mask networks of a modality."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..settings import OURS, Settings, scaled_count
from ..types import Camera, Estimate, Port, check_time, checked
from .inputs import as_camera, check_image
from .rescale import ellipse_in, network_camera, outside_training, resample, warn_of_lens
from .setup import Setup
from .weights import load_networks, own_limit

Mask = Callable[[np.ndarray], np.ndarray]
Weights = str | Path | tuple[Mask, Mask]


def settings_for(camera: Camera, events_per_window: int | None = None) -> Settings:
    """`OURS`, with N as given or else scaled to the camera's number of pixels."""
    return replace(OURS, events_per_window=events_per_window or scaled_count(camera.size_px))


def within_own_limit(settings: Settings, weights: str | Path, modality: str) -> Settings:
    """Settings whose minimum confidence is raised to that of the networks' cards; raises `InputError`."""
    limits = settings.min_confidence
    least = max(limits[modality], own_limit(weights, modality))
    return replace(settings, min_confidence=replace(limits, **{modality: least}))


class ImageEstimator:
    """Check a camera's images and resample them to the networks' pixels; `on_grid` does the rest.

    Parameters
    ----------
    camera, port, modality, weights, settings, precision
        As `Estimator`.
    """

    @checked
    def __init__(self, camera: Camera | str | Path | None, port: Port | None, modality: str, weights: Weights,
                 settings: Settings | None, precision: str):  # fmt: skip
        if modality not in ("rgb", "event"):
            raise ValueError(f"modality: expected 'rgb' or 'event', got {modality!r}")
        self.camera, self.port = as_camera(camera), port or Port.lm_map()
        self.modality, self.settings = modality, settings or settings_for(self.camera)
        self.grid = network_camera(self.camera, modality, self.settings)
        warn_of_lens(self.camera, self.port, self.settings)
        if not isinstance(weights, str | Path):
            self.ring_network, self.reflector_network = weights
            return
        self.ring_network, self.reflector_network = load_networks(weights, modality, precision)
        self.settings = within_own_limit(self.settings, weights, modality)

    @property
    def setup(self) -> Setup:
        """What the steps of the pipeline need."""
        return Setup(self.port, self.grid, self.modality, self.settings)

    def __call__(self, image: np.ndarray, t_us: int = 0) -> Estimate:
        """Estimate the pose in one image; a failed measurement is a status, not an exception.

        Raises
        ------
        ValueError
            If the image is not of the camera's size or does not suit the modality: float, grey and RGBA
            images are refused.  BGR cannot be told from RGB.
        """
        check_time("t_us", t_us)
        return self.in_camera(self.on_grid(self.to_grid(image), t_us))

    def to_grid(self, image: np.ndarray) -> np.ndarray:
        """Resample an image of the camera to the pixels of `grid`; raises ValueError as a call does."""
        check_image(image, self.modality, self.camera)
        return resample(image, self.grid)

    def in_camera(self, estimate: Estimate) -> Estimate:
        """Convert an estimate of `on_grid`: its ellipse to the camera's pixels, and note whether the ring is
        of a size outside the training's."""
        if estimate.ellipse is None:
            return estimate
        outside = outside_training(estimate.ellipse, self.settings)
        ring = ellipse_in(estimate.ellipse, self.grid, self.camera)
        return replace(estimate, ellipse=ring, outside_training=outside)

    def on_grid(self, image: np.ndarray, t_us: int = 0) -> Estimate:
        """Estimate the pose in an image in the pixels of `grid`; the ellipse is in these pixels, too."""
        raise NotImplementedError

    def ring_mask(self, image: np.ndarray) -> np.ndarray:
        """The ring's mask (H, W), in [0, 1], in the pixels of the camera's image; raises ValueError."""
        mask = resample(self.ring_network(self.to_grid(image)), self.camera)
        return np.clip(mask, 0, 1)
