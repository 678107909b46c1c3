"""Draw three of EVO's maps side by side: data/results/odometry/evo-map.png.

evo_picture.py RECORDING START_S

A room, as EVO maps it alone; two seconds of a docking sequence, as EVO maps them alone; and the same two
seconds mapped with the true poses.  Points are coloured by depth, dark is near; events are grey.  The
committed picture is of realistic-5, from 10 s on.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np

from lmmap.recordings.formats import open_recording
from lmmap_lab.studies.odometry import FOLDER

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # so that the package has one name, vo.evo

from evo_pieces import pieces, port_depth_m
from evo_scenes import CAMERA, events
from vo.evo import scenes
from vo.evo.event_frames import event_frame
from vo.evo.odometry import Odometry
from vo.evo.track import Keyframe, Track

SCENE, SCENE_EVENTS = "boxes-fast", 2_500_000


def picture(stream, keyframe: Keyframe | None) -> np.ndarray:
    """Events before a map's time in grey, and its points on them, coloured by depth, (H, W, 3)."""
    last_us = stream["t_us"][-1] if keyframe is None else keyframe.t_us
    stop = int(np.searchsorted(stream["t_us"], last_us))
    recent = stream[max(stop - 8000, 0) : stop]
    counts = event_frame(recent["x"], recent["y"], CAMERA.size_px, 3, 0)
    image = np.repeat((255 - 30 * counts)[..., None], 3, -1).astype(np.uint8)
    if keyframe is None or not (keyframe.map.depth > 0).any():
        return image
    depth = cv2.dilate(keyframe.map.depth, np.ones((3, 3)))  # so that single points are seen
    seen = depth > 0
    low, high = np.percentile(depth[seen], [5, 95])
    grey = np.clip(255 * (depth - low) / max(high - low, 1e-9), 0, 255).astype(np.uint8)
    image[seen] = cv2.applyColorMap(grey, cv2.COLORMAP_VIRIDIS)[seen]
    return image


def last_map(tracks: list[Track]) -> Keyframe | None:
    """The last map of the track with the most poses among those with a map."""
    track = max((t for t in tracks if t.keyframes), key=lambda t: len(t.t_us), default=None)
    return track and track.keyframes[-1]


def main(path: str, start_s: str) -> None:
    recording, name = open_recording(path), Path(path).stem
    room, docking = events(scenes.scene(SCENE))[:SCENE_EVENTS], pieces(recording.events, float(start_s))
    true_m = port_depth_m(name, recording.truth.at(docking["t_us"][[-1]])[0], CAMERA)
    mean_m = float(np.median(true_m[np.isfinite(true_m)]))
    maps = [(room, last_map(Odometry(CAMERA).run(room))), (docking, last_map(Odometry(CAMERA).run(docking))),
            (docking, Odometry(CAMERA).map_along(docking, recording.truth, mean_m))]  # fmt: skip
    gap = np.full((CAMERA.height_px, 10, 3), 255, np.uint8)
    left, middle, right = (picture(*pair) for pair in maps)
    cv2.imwrite(str(FOLDER / "evo-map.png"), np.hstack([left, gap, middle, gap, right]))


if __name__ == "__main__":
    main(*sys.argv[1:])
