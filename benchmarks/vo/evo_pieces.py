"""Run EVO on short pieces of the docking sequences and write data/results/odometry/evo-pieces.csv.

evo_pieces.py FOLDER

FOLDER holds the recordings that `make vo` has simulated, SEQUENCE.h5.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd

from lmmap.provenance import save_table
from lmmap.recordings.formats import open_recording
from lmmap.studies.odometry import FOLDER, SEQUENCES

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # so that the package has one name, vo.evo

from vo.evo.odometry import Odometry

STARTS_S, SECONDS = (0.0, 10.0, 20.0), 2.0


def row(recording, sequence: str, start_s: float) -> dict:
    """What became of EVO on one piece."""
    begin_us = recording.events["t_us"][0] + start_s * 1e6
    start, stop = np.searchsorted(recording.events["t_us"], [begin_us, begin_us + SECONDS * 1e6])
    tracks = Odometry(recording.camera).run(recording.events[start:stop])
    ready = [t for t in tracks if t.ready_us is not None]
    return {
        "sequence": sequence,
        "start_s": start_s,
        "seconds": SECONDS,
        "events": stop - start,
        "bootstraps_begun": len(tracks),
        "bootstraps_done": len(ready),
        "losses": sum(t.lost for t in tracks),
        "tracked_s": sum(t.t_us[-1] - t.ready_us for t in ready) * 1e-6,
        "followed_s": max(t.t_us[-1] - t.t_us[0] for t in tracks) * 1e-6,
    }


def main(folder: str) -> None:
    rows = []
    for sequence in SEQUENCES:
        recording = open_recording(Path(folder) / f"{sequence}.h5")
        for start_s in STARTS_S:
            rows.append(row(recording, sequence, start_s))
            print(f"evo: {rows[-1]}", flush=True)
    save_table(FOLDER / "evo-pieces.csv", pd.DataFrame(rows), seconds=SECONDS)


if __name__ == "__main__":
    main(*sys.argv[1:])
