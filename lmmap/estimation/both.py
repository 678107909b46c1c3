"""Estimates of both cameras together, unless they contradict each other throughout."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from ..tracking.discord import Discord
from ..tracking.fusion import fuse
from ..types import Estimate
from .estimates import merge_by_time

WAITING = 20  # answers that wait for the first pair of poses


def fused(
    estimates: Mapping[str, Iterable[Estimate]], yaw_period_rad: float, rate_hz: float | None, name: str
) -> Iterator[Estimate]:
    """`fusion.fuse` of each camera's estimates, as `in_accord` lets them pass."""
    discord = Discord(yaw_period_rad)

    def heard() -> Iterator[tuple[str, Estimate]]:
        for camera, e in merge_by_time(estimates):
            discord.add(camera, e)
            yield camera, e

    answers = ((None, e) for e in fuse(heard(), yaw_period_rad, rate_hz))
    return (e for _, e in in_accord(answers, discord, name))


def in_accord(answers: Iterable[tuple], discord: Discord, name: str) -> Iterator[tuple]:
    """``(image, estimate)`` as they come, ``unsure`` while the cameras contradict each other throughout; a
    warning at the end says so.  The first answers wait until two poses have been compared."""
    waiting = []
    for image, e in answers:
        waiting.append((image, e))
        if discord.agreed or discord.contradicted or len(waiting) > WAITING:
            yield from ((image, discord.judged(e)) for image, e in waiting)
            waiting = []
    yield from waiting
    discord.tell(name)
