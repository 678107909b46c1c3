"""EVO: tracking and mapping in two threads, with keyframes and a start from a fronto-parallel plane.

The map's frame ("world") is the camera's at the start of a track, and its unit of length is the depth of the
plane that the first map is laid on: the scale is arbitrary.

The start follows the paper: the first events are a map at depth 1, and the space sweep that follows replaces
it.  While the map is the plane, only translation is estimated, since a plane without relief hardly tells
rotation from translation.  The first stretch is then mapped and tracked again several times, over a baseline
that grows, which takes the plane's error out of the map; the papers leave that to the later keyframes.
"""

from __future__ import annotations

import time

import numpy as np

from lmmap.types import Camera, Trajectory

from . import bootstrap, mapping, tracking
from .constants import Constants
from .event_frames import event_frame
from .mapper import Mapper, Stretch, make_keyframe
from .stopwatch import Stopwatch
from .track import Keyframe, Track, orthonormal

TRANSLATION, ALL = 3, 6  # components of a pose that are estimated


class Odometry:
    """EVO over a recording's events; `run` returns its tracks, of which a new one begins after each loss."""

    def __init__(self, camera: Camera, constants: Constants | None = None):
        if any(camera.distortion):
            raise ValueError("camera: expected no lens distortion, got some; undistort the events")
        self.camera, self.constants = camera, constants or Constants()
        self.K, self.size_px = camera.K, camera.size_px
        self.times = Stopwatch()
        self._mapper = Mapper(self.K, self.size_px, self.constants)

    def run(self, events, first_depth: np.ndarray | None = None) -> list[Track]:
        """Tracks of events (N,) EVENT in the order of time.

        ``first_depth`` (H, W) takes the place of the plane, for tests of tracking and mapping alone.
        """
        c, tracks, start = self.constants, [], 0
        self._take(events)
        while start + c.bootstrap_events + c.events_per_frame < len(events):
            soonest_us = self._t_us[start] + 1e6 * c.restart_s
            track, start = self._follow(start, first_depth)
            tracks.append(track)
            start = max(start, int(np.searchsorted(self._t_us, soonest_us)))
        return tracks

    def map_along(self, events, T_cam_world: Trajectory, mean_depth: float) -> Keyframe | None:
        """The map of the last events (N,) EVENT from given poses: mapping alone, for tests of it.

        The sweep begins within the baseline of ``mean_depth``; None if it gives too few points.
        """
        c, track = self.constants, Track()
        track.event = list(range(c.events_per_frame // 2, len(events), c.events_per_step))
        track.t_us = events["t_us"][track.event].tolist()
        poses = T_cam_world.at(events["t_us"][track.event])
        track.rotation, track.position = list(poses.rotation), list(poses.position_m)
        points = (np.array([[0, 0, mean_depth]]) - poses.position_m[-1]) @ poses.rotation[-1]
        stretch = Stretch(events["x"], events["y"], track, points)
        return make_keyframe(stretch, self.K, self.size_px, c)

    def _take(self, events) -> None:
        self._t_us, self._x, self._y = (np.ascontiguousarray(events[name]) for name in ("t_us", "x", "y"))

    def _follow(self, start: int, first_depth) -> tuple[Track, int]:
        """Bootstrap at an event and track until lost or out of events; the track, and where it ended."""
        c, track, times = self.constants, Track(), self.times
        began_s = time.thread_time()
        self._bootstrap(start, first_depth)
        times.track(time.thread_time() - began_s, True)
        stop = first_stop = start + (c.bootstrap_events + c.events_per_frame) // 2
        while stop < len(self._t_us):
            began_s, frame_began_s = time.thread_time(), time.perf_counter()
            self._track(track, stop)
            if self._lost_frames >= c.lost_frames or not np.isfinite(track.position[-1]).all():
                self._mapper.drop()
                track.lost = True
                return track, stop
            times.track(time.thread_time() - began_s, self._rounds > 0)
            self._waits -= self._waits > 0
            if self._wants_map(track):
                self._begin_map(track)
            due = self._mapper.busy and len(track.t_us) >= self._map_due
            if due and self._take_map(track) and self._rounds:
                self._rounds -= 1
                if self._rounds:
                    self._return_to_start(track)
                    stop = first_stop
                    continue
            if not self._rounds:
                times.wall_s += time.perf_counter() - frame_began_s
            stop += c.events_per_step
        if self._mapper.busy:
            self._take_map(track)
        return track, len(self._t_us)

    def _bootstrap(self, start: int, first_depth) -> None:
        """The first map: events of a short time, laid on a plane (EVO)."""
        c = self.constants
        image, plane = self._frame(start, start + c.bootstrap_events), first_depth
        if plane is None:
            plane = np.ones_like(image)
            if c.bootstrap_plane == "homography":
                plane = bootstrap.planar_depth(self._x, self._y, start, self.K, self.size_px, c)
        depth = mapping.DepthMap(np.where(image > c.bootstrap_brightness, plane, 0.0), image)
        self._points = depth.points(self.K)
        self._free = ALL if np.ptp(plane) > 0 else TRANSLATION
        self._from_plane = first_depth is None
        self._rounds = c.bootstrap_rounds if self._from_plane else 0
        self._first_pose = np.eye(3), np.zeros(3)
        self._centre, self._keyframe_depth = np.zeros(3), float(np.median(self._points[:, 2]))
        self._reference, self._lost_frames, self._waits = None, 0, 0

    def _return_to_start(self, track: Track) -> None:
        """Forget the poses of the first stretch, but not the map they have led to."""
        self._first_pose = track.rotation[0], track.position[0]
        self._centre = -track.rotation[0].T @ track.position[0]
        for values in (track.t_us, track.rotation, track.position, track.event, track.keyframes):
            values.clear()

    def _frame(self, start: int, stop: int) -> np.ndarray:
        c, x, y = self.constants, self._x[start:stop], self._y[start:stop]
        return event_frame(x, y, self.size_px, c.count_limit, c.frame_blur_px)

    def _track(self, track: Track, stop: int) -> None:
        """Align the frame of the events before ``stop`` and add its pose."""
        c, middle = self.constants, stop - self.constants.events_per_frame // 2
        t_us = int(self._t_us[middle])
        R, t = self._predict(track, t_us)
        if self._reference is None:
            self._reference = tracking.project_map(self._points, R, t, self.K, self.size_px, c)
        ref = self._reference
        R_cam_ref = R @ ref.rotation.T
        t_cam_ref = t - R_cam_ref @ ref.position
        image = self._frame(stop - c.events_per_frame, stop)
        R_cam_ref, t_cam_ref, similarity, shift_px = tracking.align(
            image, ref, R_cam_ref, t_cam_ref, self.K, c, self._free
        )
        self._lost_frames = self._lost_frames + 1 if similarity < c.lost_similarity else 0
        track.t_us.append(t_us if not track.t_us else max(t_us, track.t_us[-1] + 1))
        track.rotation.append(orthonormal(R_cam_ref @ ref.rotation))
        track.position.append(R_cam_ref @ ref.position + t_cam_ref)
        track.event.append(middle)
        if shift_px > c.reference_shift_px:
            self._reference = None

    def _predict(self, track: Track, t_us: int) -> tuple[np.ndarray, np.ndarray]:
        """Pose at a time, by the velocity over the last two steps."""
        if not track.t_us:
            return self._first_pose
        R, t = track.rotation[-1], track.position[-1]
        if len(track.t_us) < 3 or self._lost_frames:
            return R, t
        share = min((t_us - track.t_us[-1]) / max(track.t_us[-1] - track.t_us[-3], 1), 1.0)
        D = 0.5 * share * (R @ track.rotation[-3].T - track.rotation[-3] @ R.T)  # of a small turn: its matrix
        turn = np.array([0, 0, 0, D[2, 1], D[0, 2], D[1, 0]])
        return tracking.exponential(turn)[0] @ R, t + share * (t - track.position[-3])

    def _wants_map(self, track: Track) -> bool:
        """Is there no map under way, and has the camera moved far enough from the last, or left it behind?"""
        c = self.constants
        if self._lost_frames or self._waits or self._mapper.busy:
            return False
        centre = -track.rotation[-1].T @ track.position[-1]
        distance = np.linalg.norm(centre - self._centre) / self._keyframe_depth
        if self._reference is not None and self._reference.visible < c.keyframe_overlap:
            return distance > c.overlap_distance
        share = 1 - self._rounds / c.bootstrap_rounds
        return distance > c.bootstrap_distance + share * (c.keyframe_distance - c.bootstrap_distance)

    def _begin_map(self, track: Track) -> None:
        """Begin a map of the last events, seen from the present pose.  A start waits for its maps."""
        c, starts = self.constants, self._from_plane and track.ready_us is None
        self._map_due = len(track.t_us) + (0 if starts else c.map_frames)
        last = track.last(c.map_events // c.events_per_step + 2)
        self._mapper.begin(Stretch(self._x, self._y, last, self._points))
        self.times.begin_map()

    def _take_map(self, track: Track) -> bool:
        """Take over the map that is due; was it one?  Its points join the map."""
        c = self.constants
        keyframe, seconds = self._mapper.take()
        self.times.take_map(seconds, self._rounds > 0)
        if keyframe is None:
            self._waits = c.map_retry_frames
            return False
        track.keyframes.append(keyframe)
        self._centre, self._keyframe_depth = -keyframe.rotation.T @ keyframe.position, keyframe.mean_depth
        local = c.local_keyframes if len(track.keyframes) > c.bootstrap_maps else 1
        self._points = np.concatenate([k.points for k in track.keyframes[-local:]])
        self._reference, self._free = None, ALL
        if len(track.keyframes) >= c.bootstrap_maps and track.ready_us is None:
            track.ready_us = track.t_us[-1]
        return True
