"""Draw EVO's maps of a scene and of a docking sequence side by side: data/results/odometry/evo-map.png.

evo_picture.py RECORDING SECONDS

Shown is the last map of the longest track in each; near points are dark.  Also prints what became of the
tracks on the recording's first seconds.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np

from lmmap.recordings.formats import open_recording
from lmmap.studies.odometry import FOLDER

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # so that the package has one name, vo.evo

from evo_scenes import CAMERA, events
from vo.evo import scenes
from vo.evo.event_frames import event_frame
from vo.evo.odometry import Odometry, Track

SCENE, SCENE_EVENTS = "boxes-fast", 2_500_000


def picture(stream, track: Track | None) -> np.ndarray:
    """Events at the last map's time in grey, and its points on them, coloured by depth, (H, W, 3)."""
    if track is None or not track.keyframes:
        last_us, depth = stream["t_us"][-1], np.zeros(CAMERA.size_px[::-1])
    else:
        last_us, depth = track.keyframes[-1].t_us, track.keyframes[-1].map.depth
    stop = int(np.searchsorted(stream["t_us"], last_us))
    some = stream[max(stop - 8000, 0) : stop]
    counts = event_frame(some["x"], some["y"], CAMERA.size_px, 3, 0)
    image = np.repeat((255 - 30 * counts)[..., None], 3, -1).astype(np.uint8)
    seen = depth > 0
    if seen.any():
        low, high = np.percentile(depth[seen], [5, 95])
        grey = np.clip(255 * (depth - low) / max(high - low, 1e-9), 0, 255).astype(np.uint8)
        image[seen] = cv2.applyColorMap(grey, cv2.COLORMAP_VIRIDIS)[seen]
    return image


def longest(tracks: list[Track]) -> Track | None:
    """The track with the most poses among those with a map."""
    return max((t for t in tracks if t.keyframes), key=lambda t: len(t.t_us), default=None)


def main(path: str, seconds: str) -> None:
    scene = events(scenes.scene(SCENE))[:SCENE_EVENTS]
    docking = open_recording(path).events
    docking = docking[: np.searchsorted(docking["t_us"], docking["t_us"][0] + float(seconds) * 1e6)]
    tracks = Odometry(CAMERA).run(docking)
    for track in tracks:
        first_s, last_s = track.t_us[0] * 1e-6, track.t_us[-1] * 1e-6
        print(f"evo: {first_s:.2f} to {last_s:.2f} s, {len(track.keyframes)} maps, "
              f"bootstrapped: {track.ready_us is not None}, lost: {track.lost}")  # fmt: skip
    left, right = picture(scene, longest(Odometry(CAMERA).run(scene))), picture(docking, longest(tracks))
    gap = np.full((CAMERA.height_px, 10, 3), 255, np.uint8)
    cv2.imwrite(str(FOLDER / "evo-map.png"), np.hstack([left, gap, right]))


if __name__ == "__main__":
    main(*sys.argv[1:])
