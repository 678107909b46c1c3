"""How long tracking and mapping take, in two threads."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass
class Stopwatch:
    """Seconds since the starts were over; ``bootstrap_s`` are those before, of both threads.

    ``two_cores_s`` is what both threads would take on cores of their own: their own times, and tracking's
    waits for maps that are due.  ``wall_s`` is what they took, beside all else that the machine did.
    """

    frames: int = 0
    bootstrap_s: float = 0.0
    tracking_s: float = 0.0
    mapping_s: float = 0.0
    two_cores_s: float = 0.0
    wall_s: float = 0.0
    _map_begun_s: float = 0.0

    def track(self, seconds: float, bootstrapping: bool) -> None:
        """Count the tracking thread's time for a frame."""
        if bootstrapping:
            self.bootstrap_s += seconds
        else:
            self.frames += 1
            self.tracking_s += seconds
            self.two_cores_s += seconds

    def begin_map(self) -> None:
        """A map is begun now, in the tracking thread's time."""
        self._map_begun_s = self.two_cores_s

    def take_map(self, seconds: float, bootstrapping: bool) -> None:
        """Count the mapping thread's time for a map, and the wait for it."""
        if bootstrapping:
            self.bootstrap_s += seconds
        else:
            self.mapping_s += seconds
            self.two_cores_s = max(self.two_cores_s, self._map_begun_s + seconds)
