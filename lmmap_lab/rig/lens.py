"""A webcam's focal length from a minute of waving the port about: a pose for each image, one lens for all.

The edges of ring and markers are measured in the images themselves, not in the networks' masks: white paper
on black is as sharp as the lens, and has all of the camera's pixels.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from lmmap.estimation.images import timed_images
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.image_estimator import settings_for
from lmmap.recordings.stream import Stream
from lmmap.types import Camera, InputError, Port

from .port_calibration import LENS_SIGMA, PortFit, adjust, with_lens
from .port_outline import dimensions_m
from .port_views import LEAST_IMAGES, MOST_IMAGES, Views, check, collect, half_height_px, spread

LEAST_CONTRAST = 30.0  # grey levels across an edge
LENS_UNKNOWNS = 4
MARKER_SIZE = 0.02  # standard deviation of the markers' length and depth, in units of them: scissors and ink
INFLATION = 2.0  # of the standard deviations, so that 95 % intervals hold 95 %; benchmarks/lens_coverage.py
KNOWN = 1 / 3  # of its standard deviation before: a coefficient is known if no more than this is left


@dataclass(frozen=True)
class Lens:
    """A camera, the standard deviations of its focal length (px) and first radial coefficient, whether that
    coefficient is known, and how many of the images agree."""

    camera: Camera
    focal_sigma_px: float
    k1_sigma: float
    k1_known: bool
    images: int
    agree: int
    settled: bool


def measure_lens(stream: Stream, port: Port, weights, rate_hz: float | None = None) -> Lens:
    """The lens that a recording's frames show; the stream's camera is the start.

    The port's size has no part in it: a port of twice the size at twice the distance looks the same.

    Raises
    ------
    InputError
        If too few images show a ring and markers, or agree on one lens.
    """
    estimator = Estimator(stream.camera, port, "rgb", weights, settings_for(stream.camera))
    timed = timed_images(stream, "rgb", rate_hz=rate_hz)
    views = collect(timed, estimator, lambda frame: np.ascontiguousarray(frame[..., 1]), MOST_IMAGES)
    check(views, stream.name)
    views = views[spread(views.T_cam_port, MOST_IMAGES, _places(views, stream.camera))]
    fit = fit_lens(views, port, stream.camera)
    if fit.kept.sum() < LEAST_IMAGES:
        raise InputError(
            f"{stream.name}: {fit.kept.sum()} of {len(fit.kept)} images agree on one lens, {LEAST_IMAGES} "
            "are needed; fix zoom and focus, and wave more slowly"
        )
    sigma = INFLATION * fit.lens_sigma
    camera = with_lens(stream.camera, fit.lens)
    known = bool(sigma[1] < KNOWN * LENS_SIGMA[1])
    camera = camera if known else replace(camera, distortion=stream.camera.distortion)
    return Lens(camera, camera.fx_px * sigma[0], sigma[1], known, views.statuses.total(), int(fit.kept.sum()),
                fit.settled)  # fmt: skip


def _places(views: Views, camera: Camera) -> np.ndarray:
    """Where in the image (N, 2) the port is, in units of an eighth of its width."""
    position = views.T_cam_port.position_m
    return 8 * camera.fx_px / camera.width_px * position[:, :2] / position[:, 2:]


def fit_lens(views: Views, port: Port, camera: Camera) -> PortFit:
    """Poses, lens and, within their tolerances, the port's dimensions that fit the edges in the images."""
    share = [port.plate_height_tolerance, port.marker_radius_tolerance, *[MARKER_SIZE] * 2,
             port.ring_width_tolerance]  # fmt: skip
    prior_m = np.maximum(np.array(share) * dimensions_m(port), 1e-4)

    def edges(points_px, normal):
        return np.array([half_height_px(image, at, n, LEAST_CONTRAST, floor=True)
                         for image, at, n in zip(views.images, points_px, normal, strict=True)])  # fmt: skip

    return adjust(views.T_cam_port, edges, port, camera, LENS_UNKNOWNS, prior_m)
