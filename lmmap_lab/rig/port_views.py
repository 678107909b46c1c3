"""A port measured from a recording: its images chosen for their views, and the edges in their masks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
from tqdm import tqdm

from lmmap.estimation.estimates import each_image, estimate_images
from lmmap.estimation.images import TimedImage, timed_images
from lmmap.pipeline.estimator import Estimator
from lmmap.pipeline.image_estimator import settings_for
from lmmap.pipeline.masks import reflector_mask
from lmmap.settings import OURS
from lmmap.types import AnyRecording, InputError, Port, Pose, Status

from .port_calibration import PortFit, adjust
from .port_outline import DIMENSIONS, OF_RING, dimensions_m

MOST_LOOKED_AT, MOST_IMAGES, LEAST_IMAGES = 240, 60, 12
REACH_PX, STEP_PX = 6.0, 0.5  # of a profile across an edge
BORDER_PX = 8.0 + REACH_PX  # around the markers: their plate may stand higher than the start has it
LEAST_PEAK = 0.5  # of a mask along a profile, for an edge to be seen
VIEW_NORMAL, VIEW_LOG_DISTANCE = 0.2, 0.25  # views that differ by as much are different
ALIKE = 3.5  # times a standard deviation, for errors that all masks share; tuning/measure_ports.py
UNDETERMINED = 0.05  # standard deviation, in units of a dimension
MORE_VIEWS = {"plate's height": "tilted views, up to 45 deg to all sides",
              "focal length": "tilted views, near and far"}  # fmt: skip


@dataclass(frozen=True)
class Views:
    """Images, in the networks' pixels, with a complete pose each; how many images had which status."""

    T_cam_port: Pose
    images: list[np.ndarray]
    statuses: Counter

    def __getitem__(self, index) -> Views:
        return Views(self.T_cam_port[index], [self.images[i] for i in index], self.statuses)


def measure_port(recording: AnyRecording, port: Port | None = None, modality: str = "rgb",
                 weights=OURS.weights, rate_hz: float | None = None,
                 focal: bool = False) -> tuple[PortFit, Views]:  # fmt: skip
    """The dimensions of the port that a recording shows, and the views that they are measured from.

    Parameters
    ----------
    port
        Where the measurement starts, and what gives the ring's radius; default: the LM-MAP.
    modality, weights
        As `Estimator`.
    rate_hz
        Images a second to choose from; default: all.
    focal
        Whether to measure the focal length as well.

    Raises
    ------
    InputError
        If too few images show a ring and markers, or agree on one port.
    """
    port, camera = port or Port.lm_map(), recording.camera
    settings = replace(settings_for(camera), marker_border_px=BORDER_PX)
    estimator = Estimator(camera, port, modality, weights, settings)
    views = collect(timed_images(recording, modality, settings, rate_hz), estimator)
    check(views, recording.name)
    views = views[spread(views.T_cam_port, MOST_IMAGES)]
    shown = tqdm(masks(views, estimator), "masks", len(views.images), unit=" images", disable=None)
    fit = adjust(views.T_cam_port, MaskEdges(shown), port, estimator.grid, focal)
    if fit.kept.sum() < LEAST_IMAGES:
        raise InputError(
            f"{recording.name}: {fit.kept.sum()} of {len(fit.kept)} images agree on one port, {LEAST_IMAGES} "
            "are needed; check the camera's calibration, and record more views"
        )
    return replace(fit, sigma_m=ALIKE * fit.sigma_m, lens_sigma=ALIKE * fit.lens_sigma), views


def collect(timed: Iterable[TimedImage], estimator: Estimator, keep: Callable | None = None,
            most: int = MOST_LOOKED_AT) -> Views:  # fmt: skip
    """The images with a pose, be it a doubtful one: a port that is not as drawn makes poses doubtful.

    Of more than twice ``most`` every second is kept, so memory does not grow with the recording.  ``keep``
    makes of an image what is kept of it; default: the image in the networks' pixels.
    """
    keep = keep or estimator.to_grid
    found, statuses = [], Counter()
    for image, estimate in tqdm(estimate_images(timed, estimator), "poses", unit=" images", disable=None):
        statuses[estimate.status] += 1
        T = estimate.doubtful if estimate.T_cam_port is None else estimate.T_cam_port
        if T is not None:
            found.append((T, keep(image)))
        if len(found) > 2 * most:
            found = found[::2]
    return Views(Pose.stack([T for T, _ in found]), [image for _, image in found], statuses)


def check(views: Views, name: str) -> None:
    """`InputError` if there are too few views, with what most images lack."""
    if len(views.images) >= LEAST_IMAGES:
        return
    count, n = views.statuses.total(), len(views.images)
    rings = count - views.statuses[Status.NO_RING] - views.statuses[Status.NO_ELLIPSE]
    if not count:
        raise InputError(f"{name}: holds no images for this --modality; try the other")
    if not rings:
        raise InputError(f"{name}: no ring found in {count} images; is it the port, in focus and whole?")
    raise InputError(
        f"{name}: {rings} of {count} images show a ring and {n} its markers as well, {LEAST_IMAGES} are "
        "needed; record longer, or give more images a second with --rate"
    )


def spread(T_cam_port: Pose, most: int, other: np.ndarray | None = None) -> np.ndarray:
    """Indices, in order, of at most so many of the poses (N,): first the view nearest to the median, then
    always the one most unlike those before, in tilt, its azimuth and distance, and in ``other`` values
    (N, K), which differ by one between different views."""
    seen_from_m = T_cam_port.inverse.position_m
    distance_m = np.linalg.norm(seen_from_m, axis=-1, keepdims=True)
    view = np.hstack([seen_from_m[:, :2] / distance_m / VIEW_NORMAL, np.log(distance_m) / VIEW_LOG_DISTANCE])
    view = view if other is None else np.hstack([view, other])
    chosen = [int(np.argmin(np.linalg.norm(view - np.median(view, 0), axis=1)))]
    nearest = np.full(len(view), np.inf)
    while len(chosen) < min(most, len(view)):
        nearest = np.minimum(nearest, np.linalg.norm(view - view[chosen[-1]], axis=1))
        nearest[chosen[-1]] = -1.0
        chosen.append(int(np.argmax(nearest)))
    return np.sort(chosen)


def masks(views: Views, estimator: Estimator) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Masks of ring and markers, (H, W) f32 each, of every image; the markers' only around its pose."""

    def both(timed: TimedImage):
        near = views.T_cam_port[timed.t_us : timed.t_us + 1]
        seen_by = estimator.port, estimator.grid, estimator.settings.marker_border_px
        reflectors = reflector_mask(estimator.reflector_network, timed.image, near, *seen_by)
        return estimator.ring_network(timed.image), reflectors

    return each_image((TimedImage(i, image) for i, image in enumerate(views.images)), both)


class MaskEdges:
    """Edges in the masks of ring and markers (H, W) of N images, as `port_calibration.adjust` asks for."""

    def __init__(self, masks: Iterable[tuple[np.ndarray, np.ndarray]]):
        self.masks = [[np.ascontiguousarray(mask, np.float32) for mask in pair] for pair in masks]

    def __call__(self, points_px, normal) -> np.ndarray:
        """Gaps (N, K) px from points (N, K, 2) along normals to where the masks fall to half their height."""
        of_markers = slice(OF_RING.stop, None)
        return np.array([
            np.concatenate([half_height_px(mask, at[own], n[own])
                            for mask, own in zip(pair, (OF_RING, of_markers), strict=True)])
            for pair, at, n in zip(self.masks, points_px, normal, strict=True)
        ])  # fmt: skip


def half_height_px(
    mask, points_px, normal, least_peak: float = LEAST_PEAK, floor: bool = False
) -> np.ndarray:
    """How far (K,) from points (K, 2) along normals (K, 2) a mask (H, W) falls to half of what it reaches
    there, at the nearest such place; NaN where it does not, or where the profile leaves the image.

    With ``floor`` heights are over the least on each profile, as an image needs: its dark is not zero.
    """
    offset_px = np.arange(-REACH_PX, REACH_PX + STEP_PX / 2, STEP_PX)
    grid = points_px[:, None] + offset_px[:, None] * normal[:, None]
    inside = np.all((grid >= 0) & (grid <= np.array(mask.shape[::-1]) - 1), (1, 2))
    profile = cv2.remap(mask, np.nan_to_num(grid, nan=-10).astype(np.float32), None, cv2.INTER_LINEAR)
    profile = profile - profile.min(1, keepdims=True) if floor else profile
    peak = profile.max(1)
    above = profile - peak[:, None] / 2
    falls = (above[:, :-1] >= 0) & (above[:, 1:] < 0)
    drop = np.where(falls, above[:, :-1] - above[:, 1:], 1.0)
    where_px = np.where(falls, offset_px[:-1] + STEP_PX * above[:, :-1] / drop, np.inf)
    gap_px = where_px[np.arange(len(where_px)), np.argmin(np.abs(where_px), 1)]
    return np.where(inside & (peak > least_peak) & np.isfinite(gap_px), gap_px, np.nan)


def undetermined(fit: PortFit, focal: bool = False) -> list[str]:
    """One line for each dimension that the views do not determine, and one if the last step was large."""
    share = dict(zip(DIMENSIONS, fit.sigma_m / np.abs(dimensions_m(fit.port)), strict=True))
    share |= {"focal length": fit.focal_ratio_sigma / fit.focal_ratio} if focal else {}
    lines = [f"the views do not determine the {name} ({100 * s:.0f} %): record "
             + MORE_VIEWS.get(name, "the port from near and far, as sharp as can be")
             for name, s in share.items() if not s < UNDETERMINED]  # fmt: skip
    return lines if fit.settled else [*lines, "the dimensions have not settled: record more views"]
