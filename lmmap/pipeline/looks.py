"""Further looks at an image that shows no sure pose, in this order:

- at the image turned by 180 degrees as well, if a ring is seen without a sure pose
  (``Settings.turned_look``);
- at the enlarged histogram of a small sensor, if it shows no pose (`rescale.enlarged_cameras`);
- by the networks that have learned a place, if those from before are not sure, so that learning cannot lose
  a sure pose;
- at a histogram of more events, if N events show no sure pose.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from functools import partial
from typing import NamedTuple

import numpy as np

from ..settings import Settings
from ..types import Estimate
from .agreement import alike, in_doubt, joined, needs_more_events
from .joint_network import turned_too
from .masks import Expected
from .rescale import enlarged_cameras


class FurtherLook(NamedTuple):
    """Who looks (``see``), after which answers (``needed``), how both answers are joined, and whether the
    look also applies if the ring's place is ``expected``."""

    see: Callable[[np.ndarray, int, Expected | None], Estimate]
    needed: Callable[[Estimate, Settings], bool]
    join: Callable[[Estimate, Estimate], Estimate]
    expected: bool = False


def further_looks(estimator, learned=None) -> list[FurtherLook]:
    """The looks that any image may need: by copies of an estimator and, if there is one, by the estimator
    whose networks have ``learned``."""
    looks, settings = [], estimator.settings
    if settings.turned_look:
        ring, reflectors = turned_too([estimator.ring_network, estimator.reflector_network])
        turned = one_look(estimator, ring_network=ring, reflector_network=reflectors)
        looks.append(FurtherLook(turned, in_doubt, _join(estimator)))
    for grid in enlarged_cameras(estimator.camera, estimator.modality, settings):
        looks.append(FurtherLook(one_look(estimator, grid=grid), _has_no_pose, _first_with_pose))
    if learned is not None:
        looks.append(
            FurtherLook(learned, needs_more_events, partial(second_opinion, estimator, learned), True)
        )
    return looks


def look_again(estimator, answer: Estimate, image: np.ndarray, t_us: int, near: Expected | None,
               wider: tuple[int, np.ndarray] | None) -> Estimate:  # fmt: skip
    """The answer for an image after all looks that it needs; arguments as those of an `Estimator`'s call."""
    looks = estimator.further
    if wider is not None:
        wide = FurtherLook(lambda *_: estimator(wider[1], wider[0]), needs_more_events, _join(estimator))
        looks = [*looks, wide]
    for look in looks:
        if (near is None or look.expected) and look.needed(answer, estimator.settings):
            answer = look.join(answer, look.see(image, t_us, near))
    return answer


def one_look(estimator, **attributes):
    """A copy of an estimator that looks only once and differs in some attributes."""
    other = copy(estimator)
    vars(other).update(attributes, further=[])
    return other


def second_opinion(estimator, learned, first: Estimate, second: Estimate) -> Estimate:
    """The first pose, confirmed or doubted by the second.

    The second pose is taken if there is no first one, or if it contradicts a less confident first one and
    reaches its own networks' minimum confidence.  A pose that an estimator would not report contradicts
    nothing.
    """
    if first.T_cam_port is None:
        return _first_with_pose(first, second)
    settings, modality = estimator.settings, estimator.modality
    assert first.found is not None
    agree = second.found is not None and alike(first.found, second.found, estimator.port, settings)
    if not agree and second.confidence < settings.min_confidence[modality]:
        return first
    both = joined([first, second], estimator.setup)
    if agree or both.found is first.found:
        return both
    return both.judged(both.confidence, learned.settings.min_confidence[modality])


def _join(estimator) -> Callable[[Estimate, Estimate], Estimate]:
    return lambda *both: joined(both, estimator.setup)


def _has_no_pose(answer: Estimate, settings: Settings) -> bool:
    return answer.T_cam_port is None


def _first_with_pose(first: Estimate, second: Estimate) -> Estimate:
    return first if second.T_cam_port is None else second
