"""Whether networks that have learned a place are taken, and how sure they must be of a pose.

The track says which poses are believed and which contradicted, of the old networks and of the new ones.  Part
of the recording teaches nothing, and there the new networks have to find more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lmmap.geometry.port import in_view
from lmmap.pipeline.estimator import Estimator
from lmmap.types import Estimate

from .self_labels import believed
from .smooth_track import SmoothTrack


@dataclass(frozen=True)
class Verdict:
    """What the images that taught nothing say of new networks.

    Attributes
    ----------
    taken
        Whether they take the old ones' place.
    min_confidence
        The limit that their poses have to reach.
    before, after
        How many reported poses are believed and contradicted, of the old and of the new networks, among the
        images that taught nothing.
    belief
        Of the old and of the new networks: mean confidence of the believed ones, over all of those images.
    images
        How many those are.
    """

    taken: bool
    min_confidence: float
    before: tuple[int, int]
    after: tuple[int, int]
    belief: tuple[float, float]
    images: int

    def __str__(self) -> str:
        (old, old_wrong), (new, new_wrong) = self.before, self.after
        return (f"of {self.images} images that taught nothing, {old} had a pose that the track believes and "
                f"{old_wrong} one that it contradicts, now {new} and {new_wrong}; mean confidence "
                f"{self.belief[0]:.2f}, now {self.belief[1]:.2f}")  # fmt: skip


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
    """

    def __init__(self, old: Sequence[Estimate], kept: Sequence[bool], track: SmoothTrack,
                 estimator: Estimator):  # fmt: skip
        self._old, self._kept, self._track, self._estimator = old, kept, track, estimator
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

    def judge(self, new: Sequence[Estimate]) -> Verdict:
        """New networks' estimates of the same images.

        Their limit is the lowest, not under that of the camera that is trusted less, at which they report no
        more contradicted poses than the old ones do.  They are taken if then, among the images that taught
        nothing, they report no fewer that are believed and no more that are contradicted, and are surer.
        """
        joint = self._track.with_more(("new", e) for e in new)
        old, new = ([(e, self._trust(e, self._track, joint)) for e in each] for each in (self._old, new))
        wrong = sorted((e.confidence for e, trust in new if trust is False), reverse=True)
        allowed = _reported(old, self._limit)[1]
        withheld = wrong[allowed : allowed + 1]  # the surest that must not be reported
        limits = self._estimator.settings.min_confidence
        least = max([limits.rgb, limits.event, *(float(np.nextafter(p, 2.0)) for p in withheld)])
        asked = [[pair for pair, kept in zip(each, self._kept, strict=True) if kept] for each in (old, new)]
        before, after = (
            _reported(each, limit) for each, limit in zip(asked, (self._limit, least), strict=True)
        )
        belief = _belief(asked[0], self._limit), _belief(asked[1], least)
        taken = after[0] >= before[0] and after[1] <= before[1] and belief[1] > belief[0]
        return Verdict(taken, least, before, after, belief, len(asked[0]))

    def _trust(self, e: Estimate, *tracks: SmoothTrack) -> bool | None:
        """What the first track that reaches an estimate says of it."""
        told = (believed(e, track, self._estimator) for track in tracks)
        return next((trust for trust in told if trust is not None), None)


def _belief(judged: Sequence[tuple[Estimate, bool | None]], limit: float) -> float:
    """Mean over images of the confidence of a pose that is reported and believed; 0 for one without."""
    sure = [e.confidence for e, trust in judged if trust and e.found is not None and e.confidence >= limit]
    return sum(sure) / max(len(judged), 1)


def _reported(judged: Sequence[tuple[Estimate, bool | None]], limit: float) -> tuple[int, int]:
    """How many poses of at least this confidence are believed, and how many contradicted."""
    told = [trust for e, trust in judged if e.found is not None and e.confidence >= limit]
    return sum(t is True for t in told), sum(t is False for t in told)
