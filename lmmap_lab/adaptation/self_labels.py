"""Which images of a recording teach the networks, and what: masks by the CAD at poses that can be believed.

A pose is believed where the images before and after, of both cameras, put the port there as well.  An image
without a pose of its own is labelled by the track, where that is known to less than a pixel.  Such images are
the hard ones.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from lmmap.estimation.estimates import each_image, estimate_image
from lmmap.estimation.images import TimedImage, timed_images
from lmmap.pipeline.agreement import alike
from lmmap.pipeline.estimator import Estimator
from lmmap.tracking.crop import ring_spread_px
from lmmap.tracking.within_limits import is_certain
from lmmap.types import AnyRecording, Estimate, Pose, Status

from ..bench.labels import label_masks
from ..bench.renderer import ray_grid
from ..rig.port_views import spread
from .smooth_track import SmoothTrack

SURE = 0.9  # confidence of a pose that is believed, if it is over the estimator's limit as well
MOST_LABELS = 120
LEAST_LABELS = 8
SIGMA_PX = 1.0  # of the ring's points, for a label by the track alone
PERIODS = 4.0  # of a recording, which are as different as two views


class Look(NamedTuple):
    """A time of `timed_images`, an image of then in the networks' pixels, and its estimate."""

    t_us: int
    image: np.ndarray
    estimate: Estimate


def look_at(recording: AnyRecording, estimator: Estimator, times_us: set[int],
            done: Mapping[int, Estimate] | None = None) -> Iterator[Look]:  # fmt: skip
    """The images of these times, and their estimates, which are not made again if ``done`` has them by their
    time."""
    timed, done = timed_images(recording, estimator.modality, estimator.settings), done or {}

    def look(shot: TimedImage) -> Look:
        known = next((done[t_us] for t_us in shot.times_us if t_us in done), None)
        if known is None:
            image, estimate = estimate_image(estimator, shot)
        else:
            image, estimate = shot.wider[1] if known.t_us != shot.t_us else shot.image, known
        return Look(shot.t_us, estimator.to_grid(image), estimate)

    return each_image((shot for shot in timed if shot.t_us in times_us), look)


def believed(estimate: Estimate, track: SmoothTrack, estimator: Estimator) -> bool | None:
    """Whether images before and after put the port where an image does; None where they do not say."""
    state = track.at(estimate.t_us, with_own=False)
    if state is None or estimate.found is None:
        return None
    told = Estimate(estimate.t_us, Status.OK, state.T_cam_port, covariance=state.pose_covariance)
    if not is_certain([told], estimator.settings)[0]:
        return None
    return alike(estimate.found, state.T_cam_port, estimator.port, estimator.settings)


def label_pose(estimate: Estimate, track: SmoothTrack, estimator: Estimator) -> Pose | None:
    """The pose that an image's masks are made of: its own where it is sure and believed, the track's where
    that is known well enough; None where neither is."""
    limit = max(SURE, estimator.settings.min_confidence[estimator.modality])
    if estimate.T_cam_port is not None and estimate.confidence >= limit:
        return estimate.T_cam_port if believed(estimate, track, estimator) else None
    state = track.at(estimate.t_us, with_own=False)
    if state is None:
        return None
    _, sigma_px = ring_spread_px(state, estimator.port, estimator.grid)
    return state.T_cam_port if np.nanmax(sigma_px, initial=0.0) < SIGMA_PX else None


def choose(looks: Sequence[Look], poses: Sequence[Pose | None], most: int = MOST_LABELS) -> list[int]:
    """Indices of at most so many looks with a pose, as different as they can be in view, distance and
    time."""
    known = [i for i, T in enumerate(poses) if T is not None]
    if not known:
        return []
    t_us = np.array([looks[i].estimate.t_us for i in known], float)
    period_us = max(np.ptp(t_us) / PERIODS, 1.0)
    return [known[k] for k in spread(Pose.stack([poses[i] for i in known]), most, t_us[:, None] / period_us)]


class Labelled:
    """Images and one filter's masks of them, as `training.dataset.Samples`."""

    def __init__(self, images: Sequence[np.ndarray], masks: Sequence[np.ndarray]):
        self._images, self._masks = images, masks

    def __len__(self) -> int:
        return len(self._images)

    def mask(self, index: int) -> np.ndarray:
        """Boolean mask (H, W)."""
        return self._masks[index]

    def image(self, index: int, events: int | None = None) -> np.ndarray:
        """Frame (H, W, 3), or histogram (H, W) of as many events as it has."""
        return self._images[index]


def labelled(
    images: Sequence[np.ndarray], poses: Sequence[Pose], estimator: Estimator
) -> tuple[Labelled, Labelled]:
    """The images with the masks of the ring, and with those of the reflectors."""
    rays = ray_grid(estimator.grid, 4)
    masks = [label_masks(T, estimator.port, estimator.grid, rays) for T in poses]
    return tuple(Labelled(images, [pair[k] for pair in masks]) for k in (0, 1))
