"""Whether networks that have learned a place are asked, and how sure they must be of a pose.

They are asked where the old ones are not sure, so what must be guarded is what they add where there was no
pose.  The track says which poses are believed and which contradicted.  Part of the recording teaches nothing,
and there the new networks, asked alone, have to explain as much as the old ones do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lmmap.geometry.port import in_view
from lmmap.pipeline.estimator import Estimator
from lmmap.types import Estimate

from .self_labels import SURE, believed
from .smooth_track import SmoothTrack

WRONG = round(1 - SURE, 9)  # of poses that are as sure as a label, what their confidence allows


@dataclass(frozen=True)
class Verdict:
    """What the images that taught nothing say of new networks.

    Attributes
    ----------
    taken
        Whether the new networks are asked.
    min_confidence
        The limit that their poses have to reach.
    before, after
        How many reported poses are believed and contradicted, of the old and of the new networks alone, among
        the images that taught nothing.
    images
        How many those are.
    more
        How many images without a pose of the old networks have one of the new that is believed, among all.
    """

    taken: bool
    min_confidence: float
    before: tuple[int, int]
    after: tuple[int, int]
    images: int
    more: int

    def __str__(self) -> str:
        (old, old_wrong), (new, new_wrong) = self.before, self.after
        return (f"of {self.images} images that taught nothing the track believes {old} poses and contradicts "
                f"{old_wrong}, of the new networks alone {new} and {new_wrong}; {self.more} images without a "
                "pose get one that it believes")  # fmt: skip


class Guard:
    """Judges a camera's networks by the images of a recording.

    Parameters
    ----------
    old
        The old networks' estimates of them.
    kept
        Which of them teach nothing, (N,).
    track
        By the old networks' estimates of all cameras.
    estimator
        With the old networks.

    Attributes
    ----------
    asked
        Which of the images (N,) the new networks have to look at: those that teach nothing, and those without
        a pose.
    """

    def __init__(self, old: Sequence[Estimate], kept: Sequence[bool], track: SmoothTrack,
                 estimator: Estimator):  # fmt: skip
        self._old, self._kept, self._track, self._estimator = old, kept, track, estimator
        self.asked = np.array([k or e.T_cam_port is None for e, k in zip(old, kept, strict=True)], bool)
        self._limit = estimator.settings.min_confidence[estimator.modality]

    def lacking(self) -> float:
        """Share of the images with the whole port in view, by the track, that have no pose that is sure and
        believed."""
        states = [self._track.at(e.t_us) for e in self._old]
        port, camera = self._estimator.port, self._estimator.camera
        shown = [e for e, state in zip(self._old, states, strict=True)
                 if state is not None and in_view(state.T_cam_port, port, camera)]  # fmt: skip
        sure = [e.T_cam_port is not None and e.confidence >= self._estimator.settings.sure_confidence
                and self._trust(e, self._track) is not False for e in shown]  # fmt: skip
        return 1 - sum(sure) / len(shown) if shown else 0.0

    def judge(self, new: Sequence[Estimate], for_later: bool = False) -> Verdict:
        """New networks' estimates of the images that they are `asked`.

        Where the old networks report no pose, those of the new ones must be as sure as a label, and so sure
        that the track contradicts no more of them than such a confidence allows.  They are taken if that
        leaves any that it believes, or if they are meant ``for_later`` images, and if, among the images that
        taught nothing, they alone report no fewer believed poses than the old ones.
        """
        joint = self._track.with_more(("new", e) for e in new)
        old = [e for e, ask in zip(self._old, self.asked, strict=True) if ask]
        is_kept = np.asarray(self._kept, bool)[self.asked]
        old, new = ([(e, self._trust(e, self._track, joint)) for e in each] for each in (old, new))
        added = [pair for pair, (first, _) in zip(new, old, strict=True) if first.T_cam_port is None]
        limits = self._estimator.settings.min_confidence
        least = _limit(added, max(SURE, limits.rgb, limits.event))
        before, after = (
            _reported([pair for pair, kept in zip(each, is_kept, strict=True) if kept], self._limit)
            for each in (old, new)
        )
        (more, _), images = _reported(added, least), int(np.sum(self._kept))
        return Verdict((more > 0 or for_later) and after[0] >= before[0], least, before, after, images, more)

    def _trust(self, e: Estimate, *tracks: SmoothTrack) -> bool | None:
        """What the first track that reaches an estimate says of it."""
        told = (believed(e, track, self._estimator) for track in tracks)
        return next((trust for trust in told if trust is not None), None)


def _limit(judged: Sequence[tuple[Estimate, bool | None]], least: float) -> float:
    """The lowest limit from this one on above which the track contradicts at most the share `WRONG` of the
    poses of which it knows."""
    raised = (float(np.nextafter(e.confidence, 2.0)) for e, trust in judged if trust is False)
    limits = sorted([least, *(limit for limit in raised if limit > least)])
    told = (_reported(judged, limit) for limit in limits)
    return next(x for x, (good, bad) in zip(limits, told, strict=True) if bad <= WRONG * (good + bad))


def _reported(judged: Sequence[tuple[Estimate, bool | None]], limit: float) -> tuple[int, int]:
    """How many poses of at least this confidence are believed, and how many contradicted."""
    told = [trust for e, trust in judged if e.found is not None and e.confidence >= limit]
    return sum(t is True for t in told), sum(t is False for t in told)
