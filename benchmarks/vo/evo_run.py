"""One run of EVO, as `evo` has it, on the events of a simulated recording, in a process of its own.

evo_run.py FOLDER MODALITY START_S TRAJECTORY

Events come from ``FOLDER.h5``.  Poses are written at the times of the event frames that the others get, so
that all counts compare; a frame before the first space sweeps are done counts as initialising.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from frames import Frames, TrackFile

from lmmap.recordings.formats import open_recording

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # so that the package has one name, vo.evo

from vo.evo.odometry import Odometry


def main(folder: str, modality: str, start_s: str, output: str, *_) -> None:
    recording = open_recording(Path(f"{folder}.h5"))
    times_s = [t_s for t_s, _ in Frames(Path(folder), modality, float(start_s)).rows]
    times_us = np.rint(1e6 * np.array(times_s)).astype(np.int64)
    events = recording.events[np.searchsorted(recording.events["t_us"], times_us[0]) :]
    found = [
        track.trajectory() for track in Odometry(recording.camera).run(events) if track.ready_us is not None
    ]
    tracks = TrackFile(Path(output))
    current = None
    for t_us in times_us.tolist():
        at = next((t for t in found if len(t) > 1 and t.t_us[0] <= t_us <= t.t_us[-1]), None)
        if at is not current:
            tracks.leave_map()
            current = at
        pose = None
        if at is not None:
            T_world_cam = at.at(np.array([t_us]))[0].inverse
            pose = [*T_world_cam.position_m, *T_world_cam.quaternion_xyzw]
        tracks.add(t_us * 1e-6, pose)
    tracks.summary()


if __name__ == "__main__":
    main(*sys.argv[1:])
