"""One run of ORB-SLAM3 (pyorbslam3 0.1.1, GPL-3) on an exported recording, in a process of its own.

orbslam3.py FOLDER MODALITY START_S TRAJECTORY VOCABULARY
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pyorbslam3
from frames import Frames, TrackFile
from pyorbslam3 import TrackingState

SETTINGS = """%YAML:1.0
File.version: "1.0"
Camera.type: "PinHole"
Camera1.fx: {fx_px}
Camera1.fy: {fy_px}
Camera1.cx: {cx_px}
Camera1.cy: {cy_px}
Camera1.k1: 0.0
Camera1.k2: 0.0
Camera1.p1: 0.0
Camera1.p2: 0.0
Camera.width: {width_px}
Camera.height: {height_px}
Camera.fps: {fps}
Camera.RGB: 0
ORBextractor.nFeatures: 1000
ORBextractor.scaleFactor: 1.2
ORBextractor.nLevels: 8
ORBextractor.iniThFAST: 20
ORBextractor.minThFAST: 7
Viewer.KeyFrameSize: 0.05
Viewer.KeyFrameLineWidth: 1.0
Viewer.GraphLineWidth: 0.9
Viewer.PointSize: 2.0
Viewer.CameraSize: 0.08
Viewer.CameraLineWidth: 3.0
Viewer.ViewpointX: 0.0
Viewer.ViewpointY: -0.7
Viewer.ViewpointZ: -1.8
Viewer.ViewpointF: 500.0
"""


def quaternion_xyzw(R: np.ndarray) -> np.ndarray:
    """Unit quaternion of a rotation: the eigenvector of Bar-Itzhack's matrix (2000)."""
    K = np.zeros((4, 4))
    K[:3, :3] = R + R.T - np.trace(R) * np.eye(3)
    K[3, :3] = K[:3, 3] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    K[3, 3] = np.trace(R)
    return np.linalg.eigh(K)[1][:, 3]


def main(folder: str, modality: str, start_s: str, output: str, vocabulary: str) -> None:
    frames, tracks = Frames(Path(folder), modality, float(start_s)), TrackFile(Path(output))
    times_s = [row[0] for row in frames.rows]
    settings = Path(output).with_suffix(".yaml")
    fps = round((len(times_s) - 1) / (times_s[-1] - times_s[0]))
    settings.write_text(SETTINGS.format(fps=fps, **frames.camera))
    slam = pyorbslam3.Slam(vocabulary, settings, pyorbslam3.Sensor.MONOCULAR)
    starting = (TrackingState.NO_IMAGES_YET, TrackingState.NOT_INITIALIZED)
    for t_s, image in frames:
        result = slam.track_monocular(image, t_s)
        if result.state in starting:
            tracks.leave_map()
        pose = None
        if result.state == TrackingState.OK:  # not RECENTLY_LOST, whose poses are only extrapolated
            T = np.asarray(result.pose_wc, float)
            pose = [*T[:3, 3], *quaternion_xyzw(T[:3, :3])]
        tracks.add(t_s, pose)
    tracks.summary()
    os._exit(0)  # its threads may hang or crash at the end, when all is written


if __name__ == "__main__":
    main(*sys.argv[1:])
