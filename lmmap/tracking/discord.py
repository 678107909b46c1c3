"""Whether the poses of two cameras agree, each by its own images.

A sensor that is mirrored or rotated, or runs on another clock, gives poses that look right one by one but
contradict those of the other camera throughout.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from ..geometry.rotations import equal_turns, step_between
from ..settings import OURS, Settings
from ..types import Estimate, Status
from .gate import match
from .motion_model import MotionState

WAITING = 20  # answers that wait for the first pair of poses
TOLD = 3  # pairs of poses that contradict each other, from which on it is said


class Discord:
    """Counts pairs of poses, one from each camera, that agree and that contradict each other.

    The poses of a pair contradict each other if they fail the gate over the time between them and differ by
    more than a right pose may be off.  A pair in which only the rival passes the gate is not counted.
    """

    def __init__(self, yaw_period_rad: float, settings: Settings = OURS):
        self.settings, self.agreed, self.contradicted = settings, 0, 0
        self._turns = equal_turns(yaw_period_rad)
        self._last: dict[str, Estimate] = {}

    def add(self, camera: str, e: Estimate) -> None:
        """Take an estimate by a camera's image alone."""
        if e.T_cam_port is None:
            return
        for other, last in self._last.items():
            if other != camera and abs(e.t_us - last.t_us) <= 1e6 * self.settings.motion.lost_s:
                self._compare(*sorted((last, e), key=lambda e: e.t_us))
        self._last[camera] = e

    def _compare(self, before: Estimate, after: Estimate) -> None:
        assert before.T_cam_port is not None and after.T_cam_port is not None
        s = self.settings
        state = MotionState.start(before.t_us, before.T_cam_port, before.covariance, s.motion)
        close = match(state.predict(after.t_us), after, self._turns, s.motion.gate)
        off = step_between(before.T_cam_port, after.T_cam_port, self._turns)
        far = np.linalg.norm(off[:3]) > s.right_position_m or np.linalg.norm(off[3:]) > s.right_rotation_rad
        self.agreed += close is not None and not close.is_rival
        self.contradicted += close is None and bool(far)

    @property
    def is_throughout(self) -> bool:
        """Whether far more pairs contradict each other than agree, so that no pose can be trusted."""
        return self.contradicted > 2 * self.agreed

    def judged(self, e: Estimate) -> Estimate:
        """The estimate, made ``unsure`` if the cameras contradict each other throughout."""
        if e.T_cam_port is None or not self.is_throughout:
            return e
        return replace(e, status=Status.UNSURE, T_cam_port=None, doubtful=e.T_cam_port)

    def tell(self, name: str) -> None:
        """Warn if the cameras contradict each other throughout."""
        if self.is_throughout and self.contradicted >= TOLD:
            pairs = f"{self.contradicted} of {self.contradicted + self.agreed} pairs"
            text = f"the two cameras' poses contradict each other in {pairs}, so none is ok"
            question = "is one mirrored or turned (--flip), or on another clock?"
            warnings.warn(f"{name}: {text}; {question}", stacklevel=2)


def watched(answers: Iterable[tuple], discord: Discord, name: str) -> Iterator[tuple]:
    """Pass ``(image, estimate)`` on, ``unsure`` while the cameras contradict each other throughout; a warning
    at the end says so.  The first answers wait until two poses have been compared."""
    waiting = []
    for image, e in answers:
        waiting.append((image, e))
        if discord.agreed or discord.contradicted or len(waiting) > WAITING:
            yield from ((image, discord.judged(e)) for image, e in waiting)
            waiting = []
    yield from waiting
    discord.tell(name)
