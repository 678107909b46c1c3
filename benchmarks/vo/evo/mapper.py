"""EVO's mapping beside its tracking: one map at a time, in a thread of its own.

A map is handed over at the frame for which it is due: if it is ready before, it waits, and if not, tracking
waits.  So the poses do not depend on how fast either thread was.  With `Constants.map_frames` of 0 tracking
always waits.
"""

from __future__ import annotations

import time
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from . import mapping, sweep
from .constants import Constants
from .track import Keyframe, Track, interpolate


@dataclass(frozen=True)
class Stretch:
    """What a map is made from: all events' pixels, a track's last poses, and the map so far (N, 3; world)."""

    x: np.ndarray
    y: np.ndarray
    track: Track
    points: np.ndarray


class Mapper:
    """Makes maps in a second thread; its kernels and OpenCV's filters run beside the first thread's."""

    def __init__(self, K, size_px, constants: Constants):
        self.K, self.size_px, self.constants = K, size_px, constants
        self._pool = ThreadPoolExecutor(1)
        self._under_way: Future | None = None

    @property
    def busy(self) -> bool:
        """Is a map begun that was not taken yet?"""
        return self._under_way is not None

    def begin(self, stretch: Stretch) -> None:
        """Begin a map; the arrays must not change before it is taken."""
        self._under_way = self._pool.submit(self._timed, stretch)

    def take(self) -> tuple[Keyframe | None, float]:
        """Wait for the map that was begun: None if it has too few points.  And its thread's time, in s."""
        under_way, self._under_way = self._under_way, None
        return under_way.result()

    def drop(self) -> None:
        """Wait for the map under way, and forget it."""
        if self.busy:
            self.take()

    def _timed(self, stretch: Stretch) -> tuple[Keyframe | None, float]:
        began_s = time.thread_time()
        keyframe = make_keyframe(stretch, self.K, self.size_px, self.constants)
        return keyframe, time.thread_time() - began_s


def make_keyframe(stretch: Stretch, K, size_px, constants: Constants) -> Keyframe | None:
    """A space sweep over the last events, seen from the last pose; None if it gives too few points."""
    c, track = constants, stretch.track
    R, t = track.rotation[-1], track.position[-1]
    z = stretch.points @ R[2] + t[2]
    mean_depth = float(np.median(z[z > 0])) if (z > 0).any() else 1.0
    start, stop = _swept_events(track, c.map_baseline * mean_depth, c)
    if stop - start < c.map_packets * c.packet_events:
        return None
    middles = np.arange(start + c.packet_events // 2, stop, c.packet_events)
    R_cam, t_cam = interpolate(middles, track)
    R_ref_cam = R @ np.swapaxes(R_cam, -1, -2)
    t_ref_cam = t - np.einsum("nij,nj->ni", R_ref_cam, t_cam)
    planes = sweep.inverse_depths(c.nearest_plane * mean_depth, c.farthest_plane * mean_depth, c.planes)
    dsi = sweep.space_sweep(stretch.x[start:stop], stretch.y[start:stop], R_ref_cam, t_ref_cam, K, size_px,
                            planes, c.packet_events)  # fmt: skip
    depth = mapping.extract(dsi, planes, c)
    seen = depth.points(K)
    if len(seen) < c.map_points:
        return None
    points, mean_depth = (seen - t) @ R, float(np.median(seen[:, 2]))
    return Keyframe(track.t_us[-1], R, t, mapping.clean(depth, c), points, mean_depth)


def _swept_events(track: Track, baseline: float, constants: Constants) -> tuple[int, int]:
    """First event and end of whole packets, seen from within ``baseline`` of the last pose."""
    c = constants
    centres = -np.einsum("nji,nj->ni", np.array(track.rotation), np.array(track.position))
    far = np.flatnonzero(np.linalg.norm(centres - centres[-1], axis=1) > baseline)
    stop = track.event[-1]
    count = min(stop - track.event[far[-1] + 1 if len(far) else 0], c.map_events)
    return stop - count // c.packet_events * c.packet_events, stop
