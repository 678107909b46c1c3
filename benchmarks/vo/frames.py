"""What both runners share: frames of an exported recording, fed in real time, and the track file.

Runs in `.venv-vo`, which has no lmmap: the two sides exchange files only.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import cv2


class Frames:
    """Grey images of ``FOLDER/MODALITY.txt`` from ``start_s`` on, each not before its time has come.

    The odometries keep a mapping thread beside the tracking one; fed faster than in real time, their maps
    would lag behind, which no camera does to them.  On a busy machine frames come later, but none is
    dropped, and none comes sooner after the one before than the camera would send it.
    """

    def __init__(self, folder: Path, modality: str, start_s: float):
        lines = (line.split() for line in (folder / f"{modality}.txt").read_text().splitlines())
        every = [(float(line[0]), folder / line[1]) for line in lines if not line[0].startswith("#")]
        self.rows = [row for row in every if row[0] >= every[0][0] + start_s]
        self.camera = json.loads((folder / "camera.json").read_text())

    def __iter__(self):
        images = [(t_s, cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)) for t_s, path in self.rows]
        due, last_s = time.monotonic(), self.rows[0][0]
        for t_s, image in images:
            due, last_s = due + t_s - last_s, t_s
            time.sleep(max(0.0, due - time.monotonic()))
            due = time.monotonic()
            yield t_s, image


class TrackFile:
    """Camera poses in the TUM format; a comment line where a new map, with its own scale, begins.

    Every line is flushed, so a crash leaves what was tracked before it.
    """

    def __init__(self, path: Path):
        self.file = path.open("w")
        self.frames = self.tracked = self.initialising = self.tracks = self.resets = 0
        self.in_map = False

    def leave_map(self) -> None:
        """The system has given up its map, or has none yet; what comes next has another scale."""
        self.resets += self.in_map
        self.in_map = False

    def add(self, t_s: float, pose) -> None:
        """One frame: x, y, z, qx, qy, qz, qw of the camera in its map, or None."""
        self.frames += 1
        if pose is None:
            self.initialising += not self.tracked
            return
        if not self.in_map:
            self.tracks += 1
            print(f"# track {self.tracks}", file=self.file)
            self.in_map = True
        self.tracked += 1
        print(f"{t_s:.6f}", *(f"{v:.7g}" for v in pose), file=self.file, flush=True)

    def summary(self) -> None:
        """Counts on standard output, for the run log."""
        names = ("frames", "initialising", "tracked", "tracks", "resets")
        counts = {name: getattr(self, name) for name in names}
        counts["lost"] = self.frames - self.initialising - self.tracked
        sys.stdout.write("\nSUMMARY " + json.dumps(counts) + "\n")
        sys.stdout.flush()
