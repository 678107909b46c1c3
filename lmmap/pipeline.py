"""From a frame or a histogram to a pose: filter, skeleton, ellipse, two circles, yaw."""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import repeat
from pathlib import Path

import numpy as np
import torch

from . import circle, contour, ellipse, joint, uncertainty, yaw
from .contour import Contour
from .core import PAPER, Camera, Ellipse, Estimate, InputError, Port, Pose, Recording, Settings, Status
from .events import histogram, scaled_count, windows_at, windows_of
from .filters import DOMAIN_GAPS, FILTERS, crop_bounds, load_filter, weight_path
from .geometry import circle_points_m, project, undistort_points
from .streams import Stream

MIN_SIGMA_PX = 0.02  # no contour is known better, whatever its scatter
AT_ONCE = 2  # images
EDGE_PX = 4  # beside the markers, for what measures their edges


def fitting(camera: Camera, events_per_window: int | None = None) -> Settings:
    """The paper's settings with N scaled to the camera's pixels, or given."""
    return replace(PAPER, events_per_window=events_per_window or scaled_count(camera.size_px))


class Estimator:
    """Pose of the port in one image.

    Parameters
    ----------
    camera, port
        Default: the bench's DAVIS 346 and the LM-MAP.
    modality
        ``"rgb"``: images (H, W, 3) u8.  ``"event"``: histograms (H, W) of event counts.
    weights
        One of `DOMAIN_GAPS` as shipped, or a folder with files named as the low-domain-gap ones.
    settings
        Default: the paper's, its number of events kept per pixel of this camera.
    precision
        Of the filters; ``"auto"`` takes bfloat16 where the processor has it, ``"float32"`` never.
    """

    def __init__(self, camera: Camera | None = None, port: Port | None = None, modality: str = "rgb",
                 weights: str | Path = "low", settings: Settings | None = None,
                 precision: str = "auto"):  # fmt: skip
        if modality not in ("rgb", "event"):
            raise ValueError(f"Estimator: modality is 'rgb' or 'event', got {modality!r}")
        self.camera, self.port = camera or Camera.davis346(), port or Port.lm_map()
        self.modality, self.settings = modality, settings or fitting(self.camera)
        shipped = weights in DOMAIN_GAPS
        paths = [weight_path(f, modality, weights if shipped else "low") for f in FILTERS]
        folder = paths[0].parent if shipped else Path(weights)
        self.ring_filter, self.reflector_filter = (
            load_filter(folder / p.name, modality, precision) for p in paths
        )

    def __call__(self, image: np.ndarray, t_us: int = 0) -> Estimate:
        """The estimate of one image; a failed measurement is a status, not an exception.

        Raises
        ------
        ValueError
            If the image's size is not the camera's.
        """
        if image.shape[:2] != self.camera.size_px[::-1]:
            shape = self.camera.size_px[::-1]
            raise ValueError(f"Estimator: the camera's images have (H, W) = {shape}, got {image.shape}")
        ring, coverage = self.find_ring(self.ring_filter(image))
        if not isinstance(ring, Contour):
            return Estimate(t_us, ring)
        fitted, candidates = ring.ellipse, self.candidates(ring.ellipse)
        reflectors = self.find_reflectors(image, candidates)
        best = yaw.fast_yaw(reflectors, candidates[:2], self.port, self.camera, self.settings)
        if best.score < self.settings.min_marker_score:
            unknown_rad = self.port.yaw_period_rad / np.sqrt(12)
            known = self.ring_uncertainty(candidates[0], ring, unknown_rad)
            return Estimate(t_us, Status.NO_MARKERS, ring=candidates[0], twin=candidates[1], ellipse=fitted,
                            arc_coverage=coverage, marker_score=best.score,
                            covariance=known.covariance)  # fmt: skip
        paper = yaw.fast_yaw(reflectors, candidates[2:], self.port, self.camera, self.settings)
        T_cam_port, covariance, tilt_sigmas = self.refine(best, ring, reflectors)
        return Estimate(t_us, Status.OK, T_cam_port, best.rival, paper.T_cam_port, fitted, coverage,
                        best.score, best.rival_score, best.margin, tilt_sigmas, covariance)  # fmt: skip

    def refine(self, best: yaw.YawFit, ring: Contour, reflectors: np.ndarray):
        """Pose with its covariance (6, 6), refined on ring and markers where the settings and enough of
        the markers' edges allow it; and the ring's distance from head-on, in standard deviations."""
        known, sigma_px = self.ring_uncertainty(best.T_cam_port, ring, best.sigma_rad), self.sigma_px(ring)
        if self.settings.refine_jointly:
            marker_sigma_px = joint.MARKER_SIGMA_PX[self.modality]
            both = joint.refine(best.T_cam_port, ring.points_px, reflectors, self.port, self.camera, sigma_px,
                                marker_sigma_px)  # fmt: skip
            if both is not None:
                covariance = joint.honest(both.covariance, best.score, joint.INFLATION[self.modality])
                return both.T_cam_port, covariance, known.tilt_sigmas
        return best.T_cam_port, known.covariance, known.tilt_sigmas

    def sigma_px(self, ring: Contour) -> float:
        """Standard deviation of a contour's point, as if all were independent."""
        return max(ring.sigma_px, MIN_SIGMA_PX) * np.sqrt(uncertainty.INFLATION[self.modality])

    def ring_uncertainty(self, T_cam_port: Pose, ring: Contour, yaw_sigma_rad: float):
        """`uncertainty.Uncertainty` of a circle's pose by its contour."""
        return uncertainty.pose_uncertainty(
            T_cam_port, ring.points_px, self.sigma_px(ring), self.port.ring_radius_m, self.camera,
            yaw_sigma_rad,
        )  # fmt: skip

    def find_ring(self, mask: np.ndarray) -> tuple[Contour | Status, float]:
        """The ring's contour, free of lens distortion, and its arc coverage; or why there is none.

        It is looked for among the mask's sure blobs, and if they hold none, in all of it.
        """
        for sure in (ellipse.SURE, 0.0):
            points = ellipse.skeleton_points(mask, self.settings.mask_threshold, sure)
            if len(points) < self.settings.min_ring_pixels:
                status = Status.NO_RING
                continue
            points = undistort_points(points, self.camera)
            fitted, inliers = ellipse.fit_ransac(points, rng=np.random.default_rng(0), settings=self.settings)
            if fitted is not None:
                break
            status = Status.NO_ELLIPSE
        else:
            return status, 0.0
        p = self.port
        stroke_px = (p.ring_outer_radius_m - p.ring_inner_radius_m) / p.ring_radius_m * fitted.semi_axes_px[0]
        found = contour.trace(fitted, mask, 1.5 * stroke_px, self.camera)
        found = found or contour.on_points(fitted, points[inliers])
        return found, ellipse.arc_coverage(found.ellipse, points)

    def candidates(self, ring: Ellipse) -> Pose:
        """Poses (4,) that a ring's ellipse leaves open, yaw apart: two exact, two by the paper's formula."""
        both = [f(ring, self.camera, self.port.ring_radius_m) for f in (circle.poses, circle.paper_poses)]
        return Pose(*(np.concatenate([getattr(T, n) for T in both]) for n in ("rotation", "position_m")))

    def find_reflectors(self, image: np.ndarray, candidates: Pose) -> np.ndarray:
        """Reflector mask (H, W), computed where poses (N,) can have markers and zero elsewhere."""
        low, high = markers_box_px(candidates, self.port, self.camera)
        rows, columns = crop_bounds(low, high, self.camera.size_px)
        mask = np.zeros(image.shape[:2], np.float32)
        mask[rows, columns] = self.reflector_filter(image[rows, columns])
        return mask


def markers_box_px(T_cam_port: Pose, port: Port, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest (u, v) that the markers and the search for them reach at poses (N,), whatever
    the yaw."""
    disc = circle_points_m(yaw.reach_m(port), 36) + np.array([0, 0, port.plate_height_m])
    seen = project(T_cam_port[:, None] @ disc, camera).reshape(-1, 2)
    seen = seen[np.isfinite(seen).all(-1)]
    if not len(seen):
        return np.zeros(2), np.array(camera.size_px) - 1
    return seen.min(0) - EDGE_PX, seen.max(0) + EDGE_PX


def images(recording: Recording | Stream, modality: str, settings: Settings | None = None,
           rate_hz: float | None = None) -> Iterator[tuple[int, np.ndarray]]:  # fmt: skip
    """Yield ``(t_us, image)``: every frame, or one histogram for each N events (or, at ``rate_hz``, the
    last N events before each tick); a histogram's time is the middle of its events' span.

    ``settings`` default to `fitting` the recording's camera.  Reads a stream as it goes.
    """
    if modality == "rgb":
        period_us = 1e6 / rate_hz if rate_hz else 0
        due = -np.inf
        for t_us, frame in recording.timed_frames():
            if t_us >= due - 1000:
                due = max(due + period_us, t_us) if np.isfinite(due) else t_us + period_us
                yield int(t_us), frame
        return
    count = (settings or fitting(recording.camera)).events_per_window
    chunks = recording.chunks()
    for some in windows_at(chunks, rate_hz, count) if rate_hz else windows_of(chunks, count):
        middle_us = (int(some["t_us"][0]) + int(some["t_us"][-1])) // 2
        yield middle_us, histogram(some["x"], some["y"], recording.camera.size_px)


def answered(shots: Iterable[tuple[int, np.ndarray]], estimator: Estimator) -> Iterator[tuple]:
    """Yield ``(image, estimate)`` for ``(t_us, image)``, in their order, two images at a time.

    On two cores that is faster than two threads on one image: the numpy half has only one.  An error among
    the images comes after the estimates of those before it.
    """
    waiting, error, shots = deque(), None, iter(shots)
    threads = max(torch.get_num_threads() // AT_ONCE, 1)
    with ThreadPoolExecutor(AT_ONCE, initializer=torch.set_num_threads, initargs=(threads,)) as pool:
        while waiting or not error:
            try:
                while not error and len(waiting) <= AT_ONCE:
                    t_us, image = next(shots)
                    waiting.append((image, pool.submit(estimator, image, t_us)))
            except (StopIteration, InputError) as end:
                error = end
            if waiting:
                image, one = waiting.popleft()
                yield image, one.result()
    if isinstance(error, InputError):
        raise error


def estimate(
    recording: Recording | Stream, estimator: Estimator, rate_hz: float | None = None
) -> Iterator[Estimate]:
    """Estimates of a whole recording, in the order of time."""
    shots = images(recording, estimator.modality, estimator.settings, rate_hz)
    for _, one in answered(shots, estimator):
        yield one


def in_time(estimates: Mapping[str, Iterable[Estimate]]) -> Iterator[tuple[str, Estimate]]:
    """``(modality, estimate)`` in the order of time, of modalities whose own estimates are in that order."""
    named = [zip(repeat(modality), some) for modality, some in estimates.items()]
    return heapq.merge(*named, key=lambda one: one[1].t_us)


def true_poses(recording: Recording | Stream, estimates: list[Estimate]) -> tuple[list[Estimate], Pose]:
    """The estimates whose time the truth covers, and the true poses then."""
    span = recording.truth.t_us
    known = [e for e in estimates if span[0] <= e.t_us <= span[-1]]
    return known, recording.truth.at(np.array([e.t_us for e in known], np.int64))
