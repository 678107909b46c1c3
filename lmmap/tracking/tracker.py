"""Track the port from image to image: search for it where its motion predicts it.

A track of both cameras, which events between the images correct, predicts the port.  The ring filter runs
only around the predicted ring, and the predicted ellipse is the first hypothesis for the ring.  What is
measured there is judged as in any image; if there is no ring where it was expected, the whole image is
searched.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import cast

import numpy as np

from ..pipeline.estimator import Estimator
from ..pipeline.inputs import check_image
from ..types import Estimate, Pose, Status, check_time, checked
from .between import Between
from .crop import expected_ring
from .discord import Discord
from .motion_model import MotionState

MOST_SUPPORT = 2  # an image that fits the track adds one to its support, up to this; any other takes one away


class Tracker:
    """Poses of the port in images of one camera or of both, as they arrive.

    Parameters
    ----------
    *estimators
        One for each kind of image, of the same camera and port.  They hold no state, so several trackers may
        share them.
    events
        Whether the camera's events will be added between the images (`add_events`).  The track then assumes
        the livelier motion of ``settings.between``, which events can follow.

    Examples
    --------
    >>> tracker = lmmap.Tracker(lmmap.Estimator(modality="rgb"))
    >>> tracker(np.zeros((260, 346, 3), np.uint8), t_us=8000).status
    <Status.NO_RING: 'no_ring'>
    """

    @checked
    def __init__(self, *estimators: Estimator, events: bool = False):
        kinds = [e.modality for e in estimators]
        if not kinds or len(set(kinds)) < len(kinds):
            raise ValueError(f"estimators: expected one for each kind of image, got {kinds}")
        if any(e.camera != estimators[0].camera or e.port != estimators[0].port for e in estimators):
            raise ValueError("estimators: expected the same camera and port, got different ones")
        self.estimators, self.settings = {e.modality: e for e in estimators}, estimators[0].settings
        first, between = estimators[0], self.settings.between
        plain = replace(between, motion=self.settings.motion, late_us=0, late_sigma_us=0.0)
        between = between if events else plain
        self._track, self._support, self._has_events = Between(first.camera, first.port, between), 0, events
        self._is_supported = False
        self._last_us: dict[str, int] = {}  # of each camera's last image
        self._since_full = dict.fromkeys(self.estimators, 0)
        self.discord = Discord(first.port.yaw_period_rad, self.settings)  # of two cameras

    @checked
    def __call__(self, image: np.ndarray, t_us: int, wider: tuple[int, np.ndarray] | None = None) -> Estimate:
        """Estimate the pose at the time of an image, from it and those before.

        Parameters
        ----------
        image
            A frame (H, W, 3) or a histogram (H, W), for which there is an estimator.
        t_us
            Its time (us), later than that of the camera's last image and not before the other's.
        wider
            Time (us) and histogram (H, W) of more events, used if the first does not show the port.

        Returns
        -------
        Estimate
            Status ``ok``: the image shows the port, and pose and covariance combine image and track.
            ``predicted``: it does not show the port where the track predicts it, and both come from earlier
            images alone.  ``unsure``: only one image supports the track and is less sure than
            ``settings.sure_confidence``, or no image does any more; or two cameras contradict each other
            throughout (`discord`).  Without a track the status is the image's.  ``confidence`` is always from
            the image alone.

        Raises
        ------
        ValueError
            For a time that repeats or goes back, and as `Estimator`.  The track is then as before.
        """
        modality = "rgb" if image.ndim == 3 else "event"
        if modality not in self.estimators:
            raise ValueError(f"image: expected one of {list(self.estimators)}, got shape {image.shape}")
        looks = [(t_us, image), *([wider] if wider else [])]
        for look_us, look in looks:
            check_time("t_us", look_us)
            check_image(look, modality, self.estimators[modality].camera)
        self._check_order(t_us, modality)
        if wider and wider[0] > t_us:
            raise ValueError(f"wider: expected a time until {t_us} us, got {wider[0]} us")
        e, fits = self._best(modality, [look for look in looks if look[0] >= self._track.first_us])
        self._last_us[modality] = t_us
        if self._predict(t_us) is None:
            self._support = 0
        return self._answer(e, modality, fits)

    def add_events(self, events) -> int:
        """Correct the pose with some or all of the events since the last image; return how many updates they
        made.

        Events from before the last image are used, too, and an image may arrive after newer events.  Events
        correct the track at their own time: `at` returns the result, and the search in the next image starts
        from it.  They begin no track, and keep none alive for longer than a prediction would.

        Parameters
        ----------
        events : (M,) EVENT
            In the order of time, also from call to call.

        Raises
        ------
        ValueError
            If times go back, or the tracker was made without ``events``.
        """
        if not self._has_events:
            raise ValueError("events: expected a Tracker(..., events=True), got one for images alone")
        return self._track.events(events)

    def at(self, t_us: int) -> Estimate:
        """Return the pose at a time not before the last image, from the images and events up to then.

        ``predicted`` after the last image that showed the port: events follow edges, but do not tell whose.
        """
        check_time("t_us", t_us)
        e = self._track.at(t_us)
        later = e.T_cam_port is not None and t_us > self._track.seen_us
        return self._judged(replace(e, status=Status.PREDICTED) if later else e)

    def _check_order(self, t_us: int, modality: str) -> None:
        last_us = self._last_us.get(modality, -np.inf)
        if t_us <= last_us or t_us < self._track.first_us:
            after_us = max(last_us, self._track.first_us)
            raise ValueError(f"t_us: expected later than {after_us} us, got {t_us} us")

    def _best(self, modality: str, looks: Iterable[tuple[int, np.ndarray]]) -> tuple[Estimate, bool]:
        """The first estimate that fits the track and True, or the last of a look with a pose and False."""
        unfit = {}  # of each look its last estimate
        for e in self._measure(modality, looks):
            if self._fits(modality, e):
                return e, True
            unfit[e.t_us] = e
        return max(unfit.values(), key=lambda e: e.T_cam_port is not None), False

    def _measure(self, modality: str, looks: Iterable[tuple[int, np.ndarray]]) -> Iterator[Estimate]:
        """Of each ``(t_us, image)`` the estimate about the predicted ring, and that of the whole image."""
        estimator = self.estimators[modality]
        for t_us, image in looks:
            state = self._predict(t_us)
            predicted = cast(Pose | None, state and state.T_cam_port)
            near = state and expected_ring(state, estimator.setup)
            self._since_full[modality] += 1
            if near and self._since_full[modality] < estimator.settings.full_frame_every:
                yield replace(estimator(image, t_us, near), predicted=predicted)
            self._since_full[modality] = 0
            yield replace(estimator(image, t_us), predicted=predicted)

    def _predict(self, t_us: int) -> MotionState | None:
        """The track's state at a time, by what was known then."""
        with self._track.before(t_us) as track:
            return track.predict(t_us)

    def _fits(self, modality: str, e: Estimate) -> bool:
        """Whether an estimate fits the track as it was known at its time."""
        with self._track.before(e.t_us) as track:
            return track.fits(self._track.as_late(modality, e, track))

    def _answer(self, e: Estimate, modality: str, fits: bool) -> Estimate:
        """What image and track say together, and the track after it."""
        self.discord.add(modality, e)
        seen = e.T_cam_port is not None
        if fits:
            self._support = min(self._support + 1, MOST_SUPPORT)
        else:
            self._support = max(self._support - 1, 0)
            if seen and not self._support:  # what contradicts the track takes its place
                self._track.restart()
                self._support, fits = 1, True
        if fits:
            self._track.add({modality: e})
        track = self._track.at(e.t_us)
        e = replace(e, measured=e.T_cam_port)
        if track.T_cam_port is None:
            return replace(e, status=Status.UNSURE, T_cam_port=None, doubtful=e.measured) if seen else e
        # a pose that one image shows is a track's beginning, but no proof of it unless the image is sure
        sure = self._support == MOST_SUPPORT or e.confidence >= self.settings.sure_confidence
        self._is_supported = sure if fits else self._support > 0
        status = Status.OK if fits else Status.PREDICTED
        e = replace(e, status=status, T_cam_port=track.T_cam_port, covariance=track.covariance)
        return self._judged(e)

    def _judged(self, e: Estimate) -> Estimate:
        """The estimate, ``unsure`` if the track that gave it is."""
        if e.T_cam_port is not None and not self._is_supported:
            return replace(e, status=Status.UNSURE, T_cam_port=None, doubtful=e.T_cam_port)
        return self.discord.judged(e)
