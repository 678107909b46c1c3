"""``lmmap live``: poses as images arrive."""

from __future__ import annotations

import json
import sys
import time
from argparse import Namespace
from collections import Counter
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace

import numpy as np

from .. import plugins
from ..estimation.images import newest_images
from ..files import check_output
from ..recordings import devices
from ..recordings.formats import load_camera
from ..recordings.journal import Journal
from ..recordings.stream import Stream
from ..tracking.tracker import Tracker
from ..types import Camera, Estimate, InputError
from .inputs import (
    check_between,
    flips_of,
    input_files,
    leave_out,
    make_estimator,
    no_images,
    open_input,
    pose_bag,
    read_from,
    table_format,
)
from .progress import in_its_colour, summary


def live(a: Namespace) -> None:
    """Estimate poses as images arrive and, between them, from events."""
    if a.between is not None:
        check_between(a)
    if a.seconds is not None and not 0 < a.seconds < 1e9:
        raise InputError(f"--seconds {a.seconds:g}: give a time above 0 s, or leave it out")
    if not read_from(a):
        leave_out(a, "live: no recording to which it applies", "fps", "time_unit", "stream")
    if not a.output:
        leave_out(a, "live: nothing is written without --output", "frame_id", "child_frame_id", "overwrite")
    else:
        check_output(a.output, input_files(a), overwrite=a.overwrite)
    device, camera, stream = _open(a)
    estimator = make_estimator(a, camera, a.modality)
    if not _estimate_live(a, device, estimator):
        if stream:
            raise no_images(stream, a.modality, estimator.settings)
        raise InputError("live: the camera sent no image; check its cable and its lens cap")


def _open(a: Namespace) -> tuple[object, Camera, Stream | None]:
    """The device that was asked for, its camera and, if it is played, its recording."""
    if isinstance(name := a.recording, str):
        device = plugins.needed("webcam", name)(name, flips_of(a))
        camera = (
            load_camera(a.camera, device.size_px)
            if a.camera
            else plugins.needed("assumed", name)(device.size_px, name)
        )
    elif a.recording:
        stream = open_input(a, checked=False)
        if stream.camera is None and not (a.modality == "rgb" and stream.source.size_px):
            stream = open_input(a)  # raises
        camera = stream.camera or plugins.needed("assumed", a.recording)(stream.source.size_px, a.recording)
        stream = replace(stream, camera=camera, checked=True)
        return devices.Played(stream), camera, stream
    elif a.camera:
        device, camera = plugins.needed("attached", "live")(flips_of(a)), load_camera(a.camera)
    else:
        raise InputError("live: no calibration; give the attached camera's with --camera")
    if camera.size_px != device.size_px:
        width, height = device.size_px
        raise InputError(f"{a.camera}: is for {camera.width_px} x {camera.height_px} px, but the camera has "
                         f"{width} x {height} px; give its own calibration")  # fmt: skip
    return device, camera, None


def _estimate_live(a: Namespace, device, estimator) -> int:
    """Print the track's answers and, however it ends, a summary; the number of images."""
    statuses, late_ms, skipped, last_us, began = [], [], 0, -np.inf, time.monotonic()
    tracker = Tracker(estimator, events=bool(a.between))
    with ExitStack() as held:
        journal = held.enter_context(pose_bag(a) or Journal(a.output, table_format(a))) if a.output else None
        page = plugins.first("--view", plugins.VIEWS, estimator.camera, estimator.port) if a.view else None
        view = held.enter_context(page) if page else None

        def tell(e: Estimate, newest_us: int) -> float:
            late_ms = (device.now_us() - newest_us) * 1e-3
            if journal:
                journal.add(e)
            print(_line(e, late_ms, a.json), flush=True)
            return late_ms

        settings = estimator.settings
        take = _Between(tracker, a.between, tell) if a.between else None
        try:
            newest = newest_images(device, a.modality, settings, seconds=a.seconds, take_events=take)
            for (t_us, image, wider), newest_us, passed_over in newest:
                skipped += passed_over + (t_us <= last_us)
                if t_us <= last_us:  # a clock that stood still or went back
                    continue
                last_us = t_us
                e = tracker(image, t_us, wider)
                late_ms.append(tell(e, newest_us))
                statuses.append(str(e.status))
                if view:
                    view.show(image, e, _facts(e, late_ms[-1]))
        except KeyboardInterrupt:
            pass
        finally:
            rate = len(statuses) / (time.monotonic() - began)
            if statuses:
                print(f"lmmap: {summary(Counter(statuses))}; {rate:.1f} images/s, {skipped} skipped, "
                      f"{np.median(late_ms):.0f} ms late", file=sys.stderr)  # fmt: skip
    return len(statuses)


class _Between:
    """Takes events as they arrive, and reports poses at a fixed rate while there is a track."""

    def __init__(self, tracker: Tracker, rate_hz: float, tell: Callable[[Estimate, int], object]):
        self._tracker, self._period_us, self._tell = tracker, 1e6 / rate_hz, tell
        self._last_us, self._told_us = np.iinfo(np.int64).min, -np.inf

    def __call__(self, events) -> None:
        newest_us = np.maximum.accumulate(np.maximum(events["t_us"], self._last_us))
        self._last_us = newest_us[-1]
        self._tracker.add_events(events[events["t_us"] == newest_us])  # none of a clock that went back
        if self._last_us >= self._told_us + self._period_us:
            e = self._tracker.at(int(self._last_us))
            if e.T_cam_port is not None:
                self._told_us = self._last_us
                self._tell(e, e.t_us)


def _line(e: Estimate, late_ms: float, as_json: bool) -> str:
    if as_json:
        return json.dumps(_facts(e, late_ms))
    status, T = in_its_colour(f"{e.status:10}", e.status), e.T_cam_port
    place = "" if T is None else "  x {:7.1f}  y {:7.1f}  z {:7.1f} mm".format(*1e3 * T.position_m)
    return f"{e.t_us * 1e-6:10.3f} s  {status}{place}  {late_ms:5.0f} ms late"


def _facts(e: Estimate, late_ms: float) -> dict:
    facts = {"t_us": e.t_us, "status": str(e.status), "confidence": round(e.confidence, 3),
             "late_ms": round(late_ms, 1)}  # fmt: skip
    poses = {"": e.T_cam_port, "predicted": e.predicted, "measured": e.measured}
    for name, T in poses.items():
        if T is not None:
            pose = {"position_m": T.position_m.tolist(), "quaternion_xyzw": T.quaternion_xyzw.tolist()}
            facts |= {name: pose} if name else pose
    return facts
