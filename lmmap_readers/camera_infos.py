"""Calibrations stored in a bag as sensor_msgs/CameraInfo, and whether its images are rectified."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path

from lmmap.recordings.bags import Dialect

CAMERA_INFO = "sensor_msgs/msg/CameraInfo"


def described(path: Path, dialect: Dialect, topics: tuple[str, ...]) -> Callable[[], dict[str, dict]]:
    """A function that returns the calibrations of a bag whose ``topics`` are read; warns if only one topic is
    rectified."""
    rectified = {name for name in topics if re.search("[_/]rect", name)}
    if rectified and len(rectified) < len(topics):
        text = f"{', '.join(rectified)} is rectified, and the other topic is not: one calibration serves both"
        warnings.warn(f"{path}: {text}; estimate each camera alone, with its own --camera", stacklevel=5)
    return partial(_cameras, path, dialect, len(rectified) == len(topics))


def _cameras(path: Path, dialect: Dialect, rectified: bool) -> dict[str, dict]:
    """The first message of each topic of sensor_msgs/CameraInfo, and after how long it ``changes``, as
    `Source.cameras`; cameras that are not calibrated come last.  For ``rectified`` images it is the
    projection, without distortion."""
    cameras, changes, last = {}, {}, {}
    with dialect.open(path) as bag:
        infos = [c for c in bag.connections if c.msgtype == CAMERA_INFO]
        for connection, recorded_ns, raw in bag.messages(infos) if infos else ():
            topic, content = connection.topic, raw[12:]  # behind the message's number and stamp
            if last.get(topic) == content:
                continue
            last[topic] = content
            info = {k.lower(): v for k, v in vars(dialect.deserialize(bag, connection, raw)).items()}
            names = ("width", "height", "distortion_model", "binning_x", "binning_y")
            camera = {name: info[name] for name in names} | {"roi": vars(info["roi"]), "rostopic": topic}
            P = info["p"].reshape(3, 4)[:, :3].ravel()
            camera |= {"k": P.tolist(), "d": []} if rectified else {n: info[n].tolist() for n in "kd"}
            if cameras.setdefault(topic, camera) != camera:
                changes.setdefault(topic, f"{(recorded_ns - bag.start_time) / 1e9:.3f} s")
    order = sorted(cameras, key=lambda topic: (not any(cameras[topic]["k"]), topic))
    return {topic: cameras[topic] | {"changes": changes.get(topic)} for topic in order}
