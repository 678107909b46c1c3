"""One image after another: the port is looked for where its motion says that it is.

A `Fusion` of both cameras predicts the port.  The ring filter runs about the predicted ring only, and the
predicted ellipse is the first hypothesis for the ring.  What is measured there is judged as in any image, and
an image without a ring where it was expected is looked at in full.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from ..pipeline.estimator import Estimator
from ..pipeline.run import TimedImage
from ..types import Estimate, Status
from .crop import expected_ring
from .fusion import Fusion

MOST_SUPPORT = 2  # images that a track is believed by: so many that do not show it there end it


class Tracker:
    """Poses of the port in images of one camera or of both, as they come.

    Parameters
    ----------
    *estimators
        One for each kind of image, of the same camera and port.  They hold no state, so several trackers may
        share them.
    """

    def __init__(self, *estimators: Estimator):
        kinds = [e.modality for e in estimators]
        if not kinds or len(set(kinds)) < len(kinds):
            raise ValueError(f"estimators: expected one for each kind of image, got {kinds}")
        if any(e.camera != estimators[0].camera or e.port != estimators[0].port for e in estimators):
            raise ValueError("estimators: expected the same camera and port, got different ones")
        self.estimators, self.settings = {e.modality: e for e in estimators}, estimators[0].settings
        self._track, self._support = self._new_track(), 0
        self._last_us: dict[str, int] = {}  # of each camera's last image
        self._since_full = 0

    def __call__(self, image: np.ndarray, t_us: int, wider: tuple[int, np.ndarray] | None = None) -> Estimate:
        """The pose at the time of an image, by it and by those before.

        Parameters
        ----------
        image
            A frame (H, W, 3) or a histogram (H, W), for which there is an estimator.
        t_us
            Its time, later than that of the camera's last image and not before the other's.
        wider
            Time and histogram of more events, to look at where the first does not show the port.

        Returns
        -------
        Estimate
            Status ``ok``: the image shows the port, and pose and covariance are of image and track together.
            ``predicted``: it does not show it where the track says, and both are of earlier images alone.
            Without a track the status is the image's.  ``confidence`` is always by the image alone.

        Raises
        ------
        ValueError
            For a time that repeats or goes back, and as `Estimator`.
        """
        modality = "rgb" if np.ndim(image) == 3 else "event"
        if modality not in self.estimators:
            raise ValueError(f"image: expected one of {list(self.estimators)}, got shape {np.shape(image)}")
        self._keep_time(t_us, modality)
        if self._track.predicted(t_us) is None:
            self._support = 0
        looks = [(t_us, image)] + ([wider] if wider and wider[0] >= self._now_us else [])
        estimates = []
        for look_us, look in looks:
            e, fits = self._measure(modality, look, look_us)
            if fits and e.T_cam_port is not None:
                return self._answer(e, modality, fits)
            estimates.append((e, fits))
        best = max(estimates, key=lambda pair: pair[0].T_cam_port is not None)
        return self._answer(best[0], modality, best[1])

    def at(self, t_us: int) -> Estimate:
        """The pose at a time not before that of the last image that showed it; ``predicted`` if later."""
        e = self._track.at(t_us)
        later = e.T_cam_port is not None and t_us > self._now_us
        return replace(e, status=Status.PREDICTED) if later else e

    @property
    def _now_us(self) -> int | float:
        """The time of the track's state."""
        return -np.inf if self._track.state is None else self._track.state.t_us

    def _new_track(self) -> Fusion:
        first = next(iter(self.estimators.values()))
        return Fusion(first.port.yaw_period_rad, self.settings.motion)

    def _keep_time(self, t_us: int, modality: str) -> None:
        last_us = self._last_us.get(modality, -np.inf)
        if t_us <= last_us or t_us < self._now_us:
            raise ValueError(f"t_us: expected later than {max(last_us, self._now_us)} us, got {t_us} us")
        self._last_us[modality] = t_us

    def _measure(self, modality: str, image: np.ndarray, t_us: int) -> tuple[Estimate, bool]:
        """The estimate about the predicted ring or, where that does not fit the track, of the whole image;
        and whether it fits."""
        estimator, state = self.estimators[modality], self._track.predicted(t_us)
        near = expected_ring(state, estimator) if state else None
        self._since_full += 1
        if near and self._since_full < self.settings.full_frame_every:
            e, fits = self._judge(estimator(image, t_us, near))
            if fits:
                return e, fits
        self._since_full = 0
        return self._judge(estimator(image, t_us))

    def _judge(self, e: Estimate) -> tuple[Estimate, bool]:
        """An estimate, and whether it fits the track.  A pose that the image alone leaves doubtful is one if
        the track expected it."""
        state = self._track.predicted(e.t_us)
        e = replace(e, predicted=state and state.T_cam_port)
        if e.status == Status.UNSURE and e.confidence >= self.settings.min_tracked_confidence:
            sure = replace(e, status=Status.OK, T_cam_port=e.doubtful, doubtful=None)
            if self._track.fits(sure):
                return sure, True
        return e, self._track.fits(e)

    def _answer(self, e: Estimate, modality: str, fits: bool) -> Estimate:
        """What image and track say together, and the track after it."""
        seen = e.T_cam_port is not None
        if fits and seen:
            self._support = min(self._support + 1, MOST_SUPPORT)
        elif not fits:
            self._support = max(self._support - 1, 0)
            if seen and not self._support:  # what contradicts the track takes its place
                self._track, self._support, fits = self._new_track(), 1, True
        if fits:
            self._track.add({modality: e})
        track = self._track.at(e.t_us)
        if track.T_cam_port is None:
            return replace(e, status=Status.UNSURE, T_cam_port=None, doubtful=e.T_cam_port) if seen else e
        status = Status.OK if fits and seen else Status.PREDICTED
        return replace(e, status=status, T_cam_port=track.T_cam_port, covariance=track.covariance)


def track_images(timed: Iterable[TimedImage], tracker: Tracker) -> Iterator[tuple[np.ndarray, Estimate]]:
    """``(image, answer)`` of each `TimedImage`, in the order of time; an image whose time is not after its
    camera's last is passed over.

    Of two images, the one of N events and the wider one, the image is that of the answer's time.
    """
    last_us: dict[int, int] = {}  # by the number of an image's axes: one camera each
    for shot in timed:
        if shot.t_us <= last_us.get(shot.image.ndim, -np.inf):
            continue
        last_us[shot.image.ndim] = shot.t_us
        e = tracker(shot.image, shot.t_us, shot.wider)
        yield (shot.wider[1] if shot.wider and e.t_us == shot.wider[0] else shot.image), e
